// SPDX-License-Identifier: MIT
#include "firmware/parameter_store.hpp"

#include <iterator>

#include "thermal/flip_sum.hpp"
#include "thermal/validate.hpp"

namespace firmware {

namespace {

constexpr int drive_count = static_cast<int>(std::size(axis_dictionary));
constexpr int heat_count = static_cast<int>(std::size(heat_dictionary));
static_assert(parameter_count == drive_count + heat_count, "an AxisSet is its parameters and nothing else");
static_assert(heat_dictionary[0].id > axis_dictionary[drive_count - 1].id);

// Where each parameter lives, in the dictionaries' order.
constexpr float AxisParameters::*drive_fields[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) &AxisParameters::name##_##unit,
#include "firmware/axis.params"
#undef PARAM
};
constexpr float HeatParameters::*heat_fields[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) &HeatParameters::name##_##unit,
#include "firmware/heat.params"
#undef PARAM
};

template <class Set>
auto& field(Set& set, int index) {
  return index < drive_count ? set.drive.*drive_fields[index] : set.heat.*heat_fields[index - drive_count];
}

int index_of(std::uint16_t id) {
  for (int i = 0; i < parameter_count; ++i) {
    if (parameter_info(i)->id == id) return i;
  }
  return -1;
}

bool same(float a, float b) { return a == b || (wire::is_unset(a) && wire::is_unset(b)); }

bool same(const ParameterSet& a, const ParameterSet& b) {
  for (int axis = 0; axis < axis_count; ++axis) {
    for (int i = 0; i < parameter_count; ++i) {
      if (!same(field(a.axes[axis], i), field(b.axes[axis], i))) return false;
    }
  }
  return true;
}

/// All that setup_from makes a heat model of.
bool same_heat(const AxisSet& a, const AxisSet& b) {
  for (int i = drive_count; i < parameter_count; ++i) {
    if (!same(field(a, i), field(b, i))) return false;
  }
  return same(a.drive.phase_resistance_ohm, b.drive.phase_resistance_ohm);
}

bool untouched(const AxisSet& set) {
  for (int i = 0; i < parameter_count; ++i) {
    if (!same(field(set, i), parameter_info(i)->fallback)) return false;
  }
  return true;
}

/// The first thing wrong with one axis: a contradiction before a missing value, electrical before thermal.
Finding finding_of(const AxisSet& set, const BoardRating& rating) {
  const Finding drive = validate(set.drive, rating);
  if (drive.id != 0) return drive;
  const Finding heat = validate(set.heat);
  if (heat.id != 0) return heat;
  // Each value may be, and the network still not: a time constant too short for the estimator's step.
  const bool usable =
      thermal::validate(heat_set(set.heat, set.drive.phase_resistance_ohm), thermal::estimator_dt_s).ok();
  return usable ? Finding{0, 0.0f, false} : Finding{heat_dictionary[0].id, set.heat.R1_K_per_W, false};
}

}  // namespace

AxisSetup setup_from(const AxisSet& set) {
  AxisSetup setup{set.drive, {}, {}, set.heat.housing_sensor_count != 0.0f};
  if (validate(set.heat).id == 0 && !wire::is_unset(set.drive.phase_resistance_ohm)) {
    setup.heat = heat_set(set.heat, set.drive.phase_resistance_ohm);
    setup.estimator = estimator_settings(set.heat);
  }
  return setup;
}

const wire::ParameterInfo* parameter_info(int index) {
  if (index < 0 || index >= parameter_count) return nullptr;
  return index < drive_count ? &axis_dictionary[index] : &heat_dictionary[index - drive_count];
}

std::uint8_t parameter_flags(int index) {
  const bool whole = index < drive_count ? drive_fields[index] == &AxisParameters::pole_pairs_count
                                         : heat_fields[index - drive_count] == &HeatParameters::housing_sensor_count;
  return static_cast<std::uint8_t>(wire::needs_disarmed | (whole ? wire::whole_number : 0));
}

float parameter_value(const AxisSet& set, int index) { return field(set, index); }

wire::Answer check(const ParameterSet& set, const BoardRating& rating) {
  for (int axis = 0; axis < axis_count; ++axis) {
    if (untouched(set.axes[axis])) continue;
    const Finding found = finding_of(set.axes[axis], rating);
    if (found.id == 0) continue;
    const auto why = found.missing ? wire::Status::parameters_unset : wire::Status::parameter_refused;
    return wire::refused(why, static_cast<std::uint8_t>(axis), found.id);
  }
  return {};
}

std::uint32_t ParameterStore::Kept::sum_now() const {
  thermal::FlipSum all;
  for (const AxisSet& axis : set.axes) {
    for (int i = 0; i < parameter_count; ++i) all.add(field(axis, i));
  }
  return all.word();
}

wire::Status ParameterStore::get(const wire::Address& of, float& value) const {
  const int index = index_of(of.id);
  if (index < 0 || of.axis >= axis_count) return wire::Status::unknown_parameter;
  value = field(in_force_.set.axes[of.axis], index);
  return wire::Status::done;
}

wire::Answer ParameterStore::stage(const wire::Assignment& one) {
  const auto& [id, axis, zero] = one.address;
  const int index = index_of(id);
  if (index < 0 || axis >= axis_count) return wire::refused(wire::Status::unknown_parameter, axis, id);
  const wire::ParameterInfo& info = *parameter_info(index);
  const bool taken_back = wire::is_unset(one.value) && wire::is_unset(info.fallback);
  if (!taken_back && !info.holds(one.value)) return wire::refused(wire::Status::parameter_refused, axis, id);
  if (!staged_.whole()) return wire::refused(wire::Status::memory_changed, axis, id);
  field(staged_.set.axes[axis], index) = one.value;
  staged_.seal();
  return {};
}

wire::Answer ParameterStore::load(wire::LoadFrom from) {
  switch (from) {
    case wire::LoadFrom::in_force:
      staged_ = in_force_;
      return {};
    case wire::LoadFrom::defaults:
      staged_.set = {};
      staged_.seal();
      return {};
    default: {
      ParameterSet saved;
      const wire::Answer answer = decode(saved);
      if (answer.status == 0) {
        staged_.set = saved;
        staged_.seal();
      }
      return answer;
    }
  }
}

wire::Answer ParameterStore::commit(Driver& driver) {
  if (!driver.at_rest()) return wire::refused(wire::Status::not_disarmed);
  if (!staged_.whole()) return wire::refused(wire::Status::memory_changed);
  const wire::Answer against = check(staged_.set, rating_);
  if (against.status != 0) return against;
  for (int i = 0; i < axis_count; ++i) {
    const AxisSet &old = in_force_.set.axes[i], &now = staged_.set.axes[i];
    driver.configure(i, setup_from(now), same_heat(old, now) ? HeatModel::unchanged : HeatModel::changed);
  }
  in_force_ = staged_;
  return {};
}

wire::Answer ParameterStore::against_saving(const Driver& driver) const {
  if (!driver.at_rest()) return wire::refused(wire::Status::not_disarmed);
  if (!whole()) return wire::refused(wire::Status::memory_changed);
  if (saved_count() > most_saved) return wire::refused(wire::Status::too_much_found);
  return check(in_force_.set, rating_);
}

bool ParameterStore::unsaved() const {
  ParameterSet saved;
  return decode(saved).status != 0 || !same(saved, in_force_.set);
}

bool ParameterStore::uncommitted() const { return !same(staged_.set, in_force_.set); }

bool ParameterStore::saved(int index) const {
  if (index < always_saved) return true;
  const float fallback = parameter_info(index)->fallback;
  return !same(field(in_force_.set.axes[0], index), fallback) || !same(field(in_force_.set.axes[1], index), fallback);
}

int ParameterStore::saved_count() const {
  int count = 0;
  for (int i = 0; i < parameter_count; ++i) count += saved(i) ? 1 : 0;
  return count;
}

/// Only of a set with no more than most_saved of them.
std::span<std::uint32_t> ParameterStore::encode(Record& record) const {
  std::uint16_t ids[most_saved + 1] = {};
  const int count = saved_count();
  std::uint32_t* word = record + header_words;
  *word++ = version;
  *word++ = static_cast<std::uint32_t>(count);
  int k = 0;
  for (int i = 0; i < parameter_count; ++i) {
    if (saved(i)) ids[k++] = parameter_info(i)->id;
  }
  const int id_words = (count + 1) / 2;
  std::memcpy(word, ids, 4 * static_cast<std::size_t>(id_words));
  word += id_words;
  for (const AxisSet& set : in_force_.set.axes) {
    for (int i = 0; i < parameter_count; ++i) {
      if (saved(i)) std::memcpy(word++, &field(set, i), 4);
    }
  }
  return {record, word};
}

/// Ids tell values apart, whatever firmware wrote them: what an older one did not know keeps its default; what this one
/// does not know comes from a newer one, and a set of which a part is lost is no set.
wire::Answer ParameterStore::decode(ParameterSet& set) const {
  set = {};
  const std::span<const std::uint8_t> payload = log_.newest().payload;
  if (payload.empty()) return wire::refused(wire::Status::nothing_saved);
  std::uint32_t head[2] = {};
  if (payload.size() >= sizeof head) std::memcpy(head, payload.data(), sizeof head);
  const std::size_t count = head[1];
  const std::size_t ids_at = sizeof head, values_at = ids_at + (count + 1) / 2 * 4;
  if (head[0] != version || count > slot_bytes || payload.size() != values_at + 4 * axis_count * count)
    return wire::refused(wire::Status::newer_record);
  ParameterSet read;
  for (std::size_t k = 0; k < count; ++k) {
    std::uint16_t id;
    std::memcpy(&id, payload.data() + ids_at + 2 * k, sizeof id);
    const int index = index_of(id);
    if (index < 0) return wire::refused(wire::Status::newer_record, wire::no_axis, id);
    for (std::size_t axis = 0; axis < axis_count; ++axis)
      std::memcpy(&field(read.axes[axis], index), payload.data() + values_at + 4 * (axis * count + k), 4);
  }
  set = read;
  return {};
}

}  // namespace firmware
