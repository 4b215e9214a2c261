// SPDX-License-Identifier: MIT
#include "boards/host/virtual/virtual_board.hpp"

#include <fmt/format.h>

#include "boards/dual_48v_20a.hpp"
#include "boards/host/stage.hpp"
#include "firmware/version.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::host {

namespace {

constexpr firmware::BoardRating rating = dual_48V_20A;
constexpr int frame_periods = 20, slow_periods = 200;  // 1 ms and 10 ms of 20 kHz
static_assert(rating.pwm_Hz == 20e3f);

firmware::DriverSetup setup_from(const firmware::ParameterSet& set) {
  return {rating, {firmware::setup_from(set.axes[0]), firmware::setup_from(set.axes[1])}};
}

}  // namespace

VirtualBoard::Usb::Usb(firmware::Driver& driver, firmware::Recorder& recorder, firmware::ParameterStore& parameters,
                       const firmware::usb::Identity& identity)
    : link(driver, recorder, parameters, identity),
      text(link),
      device(controller, identity, link, text),
      bus(controller, device) {
  controller.connect(true);
}

VirtualBoard::VirtualBoard(const VirtualBoardOptions& options)
    : options_(options), identity_{"virtual", firmware::version, options_.serial.c_str()} {
  plant_ =
      options_.full_motors ? full_plant(options_.motor, rating, options_.seed) : simple_plant(options_.motor, rating);
  if (options_.has_parameters) save_parameters_of_motor();
  power_cycle();
}

void VirtualBoard::save_parameters_of_motor() {
  const firmware::AxisSet set{firmware::parameters_from(options_.motor, rating, {48.0f, 0.0f}),
                              firmware::heat_parameters_from(options_.motor, thermal::sheet_trust)};
  need_drivable("This motor", set, rating);
  firmware::ParameterStore workshop(rating);
  firmware::Driver driver(setup_from({}));
  wire::Answer answer = workshop.start(flash_);
  for (int i = 0; i < firmware::parameter_count; ++i) {
    for (std::uint8_t axis = 0; axis < firmware::axis_count; ++axis)
      answer = workshop.stage({{firmware::parameter_info(i)->id, axis}, firmware::parameter_value(set, i)});
  }
  answer = workshop.commit(driver);
  if (answer.status == 0) {
    for (int axis = 0; axis < firmware::axis_count; ++axis) (void)driver.axis(axis).tick({});  // takes them over
    answer = workshop.save(driver, flash_);
  }
  if (answer.status == 0) return;
  const wire::CodeText text = wire::text_of(answer.status);
  wire::pc::refuse(fmt::format("This motor's parameters are not saved: {}; {}.", text.happened, text.advice));
}

void VirtualBoard::power_cycle() {
  usb_.reset();
  recorder_ = std::make_unique<firmware::Recorder>();
  parameters_.emplace(rating);
  const wire::Answer saved = parameters_->start(flash_);
  driver_.emplace(setup_from(parameters_->in_force()));
  if (saved.status != 0 && static_cast<wire::Status>(saved.status) != wire::Status::nothing_saved) {
    for (std::uint8_t i = 0; i < firmware::axis_count; ++i)
      driver_->axis(i).hold({wire::Fault::parameters, i, 0.0f, static_cast<float>(saved.id), 0.0f});
  }
  usb_.emplace(*driver_, *recorder_, *parameters_, identity_);
}

void VirtualBoard::advance(int periods) {
  for (int i = 0; i < periods; ++i) {
    hal::Duty next[firmware::axis_count];
    std::uint32_t sequence = 0;
    for (int axis = 0; axis < firmware::axis_count; ++axis) {
      const hal::AxisSample sample = plant_->sample(axis);
      next[axis] = driver_->axis(axis).tick(sample);
      sequence = sample.sequence;
    }
    recorder_->tick(sequence);
    plant_->advance(next);
    ++periods_;
    if (periods_ % frame_periods == 0) {
      driver_->watch();
      usb_->bus.frame();
      usb_->link.work(flash_);
      if (!usb_->link.looks_ahead()) driver_->look_ahead();  // one at a time, as on the H8-15D
    }
    if (periods_ % slow_periods == 0) driver_->slow_tick(plant_->slow(), {plant_->slow(0), plant_->slow(1)});
  }
}

double VirtualBoard::period_s() const { return 1 / static_cast<double>(rating.pwm_Hz); }
double VirtualBoard::time_s() const { return static_cast<double>(periods_) * period_s(); }

}  // namespace boards::host
