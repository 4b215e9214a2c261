// SPDX-License-Identifier: MIT
#include "firmware/link/commands.hpp"

#include <algorithm>
#include <bit>

#include "firmware/link/dictionary.hpp"

namespace firmware {

using wire::Kind;
using wire::Status;

namespace {

/// Which payloads a request may have: `head` bytes and up to `most` elements of a list.
struct Shape {
  Kind kind;
  std::size_t head, element, most;
};
constexpr Shape shapes[] = {
    {Kind::hello, 0, 0, 0},
    {Kind::describe_parameter, sizeof(wire::Index), 0, 0},
    {Kind::describe_signal, sizeof(wire::Index), 0, 0},
    {Kind::get, 0, sizeof(wire::Address), (wire::max_payload - sizeof(wire::Answer)) / sizeof(float)},
    {Kind::stage, 0, sizeof(wire::Assignment), wire::max_payload / sizeof(wire::Assignment)},
    {Kind::commit, 0, 0, 0},
    {Kind::save, 0, 0, 0},
    {Kind::load, sizeof(wire::Load), 0, 0},
    {Kind::arm, sizeof(wire::Axes), 0, 0},
    {Kind::disarm, sizeof(wire::Axes), 0, 0},
    {Kind::clear, sizeof(wire::Axes), 0, 0},
    {Kind::setpoint, sizeof(wire::Setpoints), 0, 0},
    {Kind::state, 0, 0, 0},
    {Kind::fault, sizeof(wire::Axes), 0, 0},
    {Kind::calibrate, sizeof(wire::Axes), 0, 0},
    {Kind::mode, sizeof(wire::ChooseMode), 0, 0},
    {Kind::ask, sizeof(wire::Ask), sizeof(wire::Segment), wire::max_segments},
    {Kind::subscribe, sizeof(wire::Subscribe), sizeof(wire::SignalAddress), wire::max_signals},
    {Kind::capture, sizeof(wire::CaptureOrder), sizeof(wire::SignalAddress), wire::max_signals},
    {Kind::capture_status, 0, 0, 0},
    {Kind::capture_read, sizeof(wire::Index), 0, 0},
};

template <class Message>
Message head_of(const wire::Frame& request) {
  Message message{};
  std::memcpy(&message, request.payload, sizeof message);  // well_formed() saw to the length
  return message;
}

template <class Element>
Element element_of(const wire::Frame& request, std::size_t head, std::size_t index) {
  Element element{};
  std::memcpy(&element, request.payload + head + index * sizeof element, sizeof element);
  return element;
}

bool names_axes(std::uint8_t mask) { return mask != 0 && mask < 1u << axis_count; }
int lowest_axis(std::uint8_t mask) { return std::countr_zero(mask); }

template <std::size_t room>
void copy_text(char (&to)[room], const char* from) {
  for (std::size_t i = 0; i + 1 < room && *from != 0; ++i) to[i] = *from++;
}

/// Rows from `row_at(0)` on, as long as they follow each other without a gap and fit; returns how many.
template <class RowAt>
std::uint32_t put_rows(std::uint32_t available, const Selection& selection, std::uint32_t dropped, RowAt row_at,
                       Reply& reply) {
  const auto room = static_cast<std::uint32_t>(wire::max_row_values / selection.count);
  const std::uint32_t most = std::min({available, room, std::uint32_t{255}}), first = row_at(0)[0];
  std::uint32_t rows = 1;
  while (rows < most && row_at(rows)[0] == first + rows * selection.decimation) ++rows;
  reply.put(wire::Rows{{},
                       first,
                       dropped,
                       static_cast<std::uint16_t>(selection.decimation),
                       static_cast<std::uint8_t>(selection.count),
                       static_cast<std::uint8_t>(rows)});
  for (std::uint32_t k = 0; k < rows; ++k) {
    for (std::uint32_t i = 0; i < selection.count; ++i) reply.put(selection.places[i].value_of(row_at(k)[1 + i]));
  }
  return rows;
}

}  // namespace

void Reply::text(const char* text) {
  while (*text != 0 && count_ + 1u < sizeof bytes_) bytes_[count_++] = static_cast<std::uint8_t>(*text++);
  if (count_ < sizeof bytes_) bytes_[count_++] = 0;
}

bool Commands::well_formed(const wire::Frame& request, Reply& reply) {
  for (const Shape& shape : shapes) {
    if (static_cast<std::uint8_t>(shape.kind) != request.kind) continue;
    const bool fits = shape.element == 0
                          ? request.bytes == shape.head
                          : request.bytes >= shape.head && (request.bytes - shape.head) % shape.element == 0 &&
                                (request.bytes - shape.head) / shape.element <= shape.most;
    if (!fits) reply.refuse(Status::wrong_length);
    return fits;
  }
  reply.refuse(Status::unknown_command);
  return false;
}

bool Commands::is_errand(std::uint8_t kind) {
  const auto k = static_cast<Kind>(kind);
  return k == Kind::commit || k == Kind::save || k == Kind::load || k == Kind::ask;
}

void Commands::answer(const wire::Frame& request, bool parameters_free, Reply& reply) {
  const auto kind = static_cast<Kind>(request.kind);
  switch (kind) {
    case Kind::hello:
      if (parameters_free) parameters_.take_back();
      return hello(reply);
    case Kind::describe_parameter:
      return describe_parameter(head_of<wire::Index>(request).index, reply);
    case Kind::describe_signal:
      return describe_signal(head_of<wire::Index>(request).index, reply);
    case Kind::get:
      return get(request, reply);
    case Kind::stage:
      return parameters_free ? stage(request, reply) : reply.refuse(Status::busy);
    case Kind::setpoint:
      return set(head_of<wire::Setpoints>(request), reply);
    case Kind::mode:
      return choose(head_of<wire::ChooseMode>(request), reply);
    case Kind::state:
      return reply.put(state());
    case Kind::subscribe:
      return subscribe(request, reply);
    case Kind::capture:
      return capture(request, reply);
    case Kind::capture_status:
      return capture_status(reply);
    case Kind::capture_read:
      return capture_read(head_of<wire::Index>(request).index, reply);
    case Kind::arm:
      if (!parameters_free) return reply.refuse(Status::busy);
      [[fallthrough]];
    case Kind::disarm:
    case Kind::clear:
    case Kind::fault:
    case Kind::calibrate:
      return for_axes(kind, head_of<wire::Axes>(request).mask, reply);
    case Kind::commit:  // errands
    case Kind::save:
    case Kind::load:
    case Kind::ask:
    case Kind::telemetry:  // never asked for
      return;
  }
}

/// A program that begins: what an earlier one had subscribed ends, and what it had staged is nobody's.
void Commands::hello(Reply& reply) {
  recorder_.stream({});
  wire::Hello hello{};
  hello.protocol = wire::protocol_version;
  hello.max_payload = wire::max_payload;
  hello.dictionary_hash = dictionary_hash;
  hello.parameters = parameter_count;
  hello.signals = axis_signal_count;
  hello.axes = axis_count;
  hello.pwm_Hz = parameters_.rating().pwm_Hz;
  hello.capture_words = Recorder::capture_words;
  hello.bus_min_V = parameters_.rating().bus_min_V;
  hello.bus_max_V = parameters_.rating().bus_max_V;
  copy_text(hello.board, identity_.board);
  copy_text(hello.firmware, identity_.firmware);
  copy_text(hello.serial, identity_.serial);
  reply.put(hello);
}

void Commands::describe_parameter(std::uint16_t index, Reply& reply) const {
  const wire::ParameterInfo* const info = parameter_info(index);
  if (info == nullptr) return reply.refuse(Status::unknown_parameter);
  const wire::ParameterInfo& p = *info;
  reply.put(wire::ParameterText{{}, p.id, axis_count, parameter_flags(index), p.min, p.max, p.fallback});
  reply.text(p.name);
  reply.text(wire::text_of(p.unit));
  reply.text(p.doc);
}

void Commands::describe_signal(std::uint16_t index, Reply& reply) const {
  if (index >= axis_signal_count) return reply.refuse(Status::no_such_signal);
  const SignalInfo& s = axis_signals[index];
  reply.put(wire::SignalText{{}, s.id, axis_count});
  reply.text(s.name);
  reply.text(s.unit);
  reply.text(s.doc);
}

void Commands::get(const wire::Frame& request, Reply& reply) const {
  const std::size_t count = request.bytes / sizeof(wire::Address);
  float value = 0.0f;
  for (std::size_t i = 0; i < count; ++i) {
    const auto address = element_of<wire::Address>(request, 0, i);
    const Status found = parameters_.get(address, value);
    if (found != Status::done) return reply.refuse(found, address.axis, address.id);
  }
  reply.put(wire::Answer{});
  for (std::size_t i = 0; i < count; ++i) {
    (void)parameters_.get(element_of<wire::Address>(request, 0, i), value);
    reply.put(value);
  }
}

void Commands::stage(const wire::Frame& request, Reply& reply) {
  const std::size_t count = request.bytes / sizeof(wire::Assignment);
  for (std::size_t i = 0; i < count; ++i) {
    const wire::Answer found = parameters_.stage(element_of<wire::Assignment>(request, 0, i));
    if (found.status != 0) return reply.put(found);
  }
  reply.put(wire::Answer{});
}

void Commands::for_axes(Kind kind, std::uint8_t mask, Reply& reply) {
  if (!names_axes(mask)) return reply.refuse(Status::no_such_axis);
  if (kind == Kind::fault) return fault(lowest_axis(mask), reply);
  if (kind == Kind::calibrate) return offsets(lowest_axis(mask), reply);
  if (kind == Kind::arm) {  // all of them or none
    for (int i = 0; i < axis_count; ++i) {
      const Status status = mask >> i & 1 ? driver_.axis(i).against_arming() : Status::done;
      if (status != Status::done) return reply.refuse(status, static_cast<std::uint8_t>(i));
    }
  }
  for (int i = 0; i < axis_count; ++i) {
    if (!(mask >> i & 1)) continue;
    Axis& axis = driver_.axis(i);
    Status status = Status::done;
    if (kind == Kind::arm) status = axis.arm();
    if (kind == Kind::disarm) axis.disarm();
    if (kind == Kind::clear) status = axis.clear();
    if (status != Status::done) return reply.refuse(status, static_cast<std::uint8_t>(i));
  }
  reply.put(wire::Answer{});
}

void Commands::choose(const wire::ChooseMode& wish, Reply& reply) {
  if (!names_axes(wish.mask)) return reply.refuse(Status::no_such_axis);
  if (static_cast<int>(wish.mode) >= wire::control_mode_count) return reply.refuse(Status::out_of_range);
  for (const bool obeys : {false, true}) {  // all of them or none
    for (int i = 0; i < axis_count; ++i) {
      if (!(wish.mask >> i & 1)) continue;
      Axis& axis = driver_.axis(i);
      const Status status = obeys ? axis.choose(wish.mode) : axis.against(wish.mode);
      if (status != Status::done) return reply.refuse(status, static_cast<std::uint8_t>(i));
    }
  }
  reply.put(wire::Answer{});
}

void Commands::set(const wire::Setpoints& wish, Reply& reply) {
  if (!names_axes(wish.mask)) return reply.refuse(Status::no_such_axis);
  Status refused[axis_count]{};
  for (int i = 0; i < axis_count; ++i) {
    if (!(wish.mask >> i & 1)) continue;
    Axis& axis = driver_.axis(i);
    const bool torque = wish.mode[i] == wire::ControlMode::torque;
    if (static_cast<int>(wish.mode[i]) >= wire::control_mode_count) {
      refused[i] = Status::out_of_range;
      continue;
    }
    refused[i] = torque ? axis.set_torque(wish.id_A[i], wish.q[i]) : axis.set_current({wish.id_A[i], wish.q[i]});
  }
  wire::State now = state();
  for (int i = 0; i < axis_count; ++i) now.axis[i].refused = static_cast<std::uint8_t>(refused[i]);
  reply.put(now);
}

wire::State Commands::state() const {
  wire::State now{};
  now.period = recorder_.period();
  for (int i = 0; i < axis_count; ++i) {
    const Axis& axis = driver_.axis(i);
    const FastView fast = axis.fast();
    const AxisState& slow = axis.state();
    if (i == 0 || axis.sees()) now.bus_V = fast.bus_V;  // one bus: an axis that sees nothing tells of another time
    wire::AxisReport& report = now.axis[i];
    report.mode = static_cast<std::uint8_t>(axis.mode());
    report.limit = static_cast<std::uint8_t>(fast.limit);
    report.fault = static_cast<std::uint8_t>(axis.fault().fault);
    report.control = axis.control();
    report.id_A = fast.current_A.d;
    report.iq_A = fast.current_A.q;
    report.speed_rad_per_s = fast.rad_per_s;
    report.rotor_rad = fast.rotor_rad;
    report.core_degC = std::max({slow.core_degC[0], slow.core_degC[1], slow.core_degC[2]});
    report.core_sigma_K = slow.core_sigma_K;
    report.housing_degC = slow.housing_degC;
    report.allowance_A = slow.allowance_A;
    report.estimate_flags = slow.estimate_flags;
    report.time_left_s = slow.time_left_s;
    report.allowance_1s_A = slow.allowance_1s_A;
  }
  return now;
}

void Commands::fault(int axis, Reply& reply) const {
  const FaultRecord f = driver_.axis(axis).fault();
  reply.put(wire::FaultEvidence{
      {}, static_cast<std::uint8_t>(f.fault), static_cast<std::uint8_t>(axis), 0, f.value, f.threshold, f.age_s});
}

/// Nothing to be started: an axis that is off learns them all the time.
void Commands::offsets(int axis, Reply& reply) const {
  const Axis& a = driver_.axis(axis);
  if (!a.offset_known()) return reply.refuse(Status::offset_unknown, static_cast<std::uint8_t>(axis));
  const Abc& offset_A = a.current_offset_A();
  reply.put(wire::Offsets{{}, {offset_A.a, offset_A.b, offset_A.c}});
}

SignalPlace Commands::place(const wire::SignalAddress& address) const {
  return address.axis < axis_count ? driver_.axis(address.axis).signal(address.id) : SignalPlace{};
}

bool Commands::select(const wire::Frame& request, std::size_t head, std::uint16_t decimation, Selection& selection,
                      Reply& reply) const {
  if (decimation == 0) {
    reply.refuse(Status::out_of_range);
    return false;
  }
  selection.decimation = decimation;
  selection.count = static_cast<std::uint32_t>((request.bytes - head) / sizeof(wire::SignalAddress));
  for (std::uint32_t i = 0; i < selection.count; ++i) {
    const auto address = element_of<wire::SignalAddress>(request, head, i);
    selection.places[i] = place(address);
    if (selection.places[i].exists()) continue;
    reply.refuse(Status::no_such_signal, address.axis, address.id);
    return false;
  }
  return true;
}

void Commands::subscribe(const wire::Frame& request, Reply& reply) {
  Selection selection;
  const auto wish = head_of<wire::Subscribe>(request);
  if (!select(request, sizeof wish, wish.decimation, selection, reply)) return;
  recorder_.stream(selection);
  reply.put(wire::Answer{});
}

void Commands::capture(const wire::Frame& request, Reply& reply) {
  Selection selection;
  Trigger trigger;
  const auto order = head_of<wire::CaptureOrder>(request);
  if (!select(request, sizeof order, order.decimation, selection, reply)) return;
  trigger.edge = order.edge;
  trigger.level = order.level;
  const bool ends = selection.count == 0;
  if (order.edge > wire::Edge::falling || (order.post == 0 && !ends)) return reply.refuse(Status::out_of_range);
  if (order.edge != wire::Edge::now) {
    trigger.place = place(order.trigger);
    if (!trigger.place.exists()) return reply.refuse(Status::no_such_signal, order.trigger.axis, order.trigger.id);
  }
  const std::uint32_t rows = static_cast<std::uint32_t>(order.pre) + order.post;
  if (rows * selection.row_words() > Recorder::capture_words) return reply.refuse(Status::capture_too_long);
  recorder_.capture(selection, trigger, order.pre, order.post);
  reply.put(wire::Answer{});
}

void Commands::capture_status(Reply& reply) const {
  const wire::CapturePhase phase = recorder_.phase();
  const bool whole = phase == wire::CapturePhase::complete;
  reply.put(wire::CaptureStatus{{},
                                phase,
                                static_cast<std::uint8_t>(recorder_.captured().count),
                                static_cast<std::uint16_t>(recorder_.captured_rows()),
                                static_cast<std::uint16_t>(whole ? recorder_.rows_before_trigger() : 0),
                                static_cast<std::uint16_t>(recorder_.captured().decimation),
                                whole ? recorder_.trigger_period() : 0});
}

void Commands::capture_read(std::uint16_t first, Reply& reply) const {
  const std::uint32_t rows = recorder_.captured_rows();
  if (first >= rows) return reply.refuse(Status::nothing_captured);
  (void)put_rows(
      rows - first, recorder_.captured(), 0, [&](std::uint32_t k) { return recorder_.captured_row(first + k); }, reply);
}

bool Commands::telemetry(Reply& reply) {
  const std::uint32_t available = recorder_.stream_rows();
  if (available == 0) return false;
  const std::uint32_t rows = put_rows(
      available, recorder_.streamed(), recorder_.dropped(), [&](std::uint32_t k) { return recorder_.stream_row(k); },
      reply);
  recorder_.stream_release(rows);
  return true;
}

}  // namespace firmware
