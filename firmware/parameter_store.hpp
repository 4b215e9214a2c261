// SPDX-License-Identifier: MIT
// The parameters of both axes: what is in force, what is staged, what is saved. Whoever speaks to a person (USB, the
// debugger's door, a test) calls these functions and no others:
//
//   stage one by one -> commit: checked as a whole, then in force -> save: in force, to flash, read back
//
// Commit and save are refused unless both axes are disarmed. Hardware limits are the board's (BoardRating) and stand in
// no dictionary. A saved set that contradicts itself or comes from a newer firmware is not used. One context below the
// control interrupt, the one that arms; not for an ISR.
#pragma once

#include "firmware/driver.hpp"
#include "firmware/heat_parameters.hpp"
#include "firmware/record_log.hpp"
#include "wire/protocol.hpp"

namespace firmware {

struct AxisSet {
  AxisParameters drive;
  HeatParameters heat;
};
struct ParameterSet {
  AxisSet axes[axis_count];
};

/// What the driver is set up with: an axis whose set is incomplete gets one that refuses to arm.
[[nodiscard]] AxisSetup setup_from(const AxisSet& set);

inline constexpr int parameter_count = static_cast<int>(sizeof(AxisSet) / sizeof(float));
/// Of both dictionaries, ids rising; null beyond. All of them are per axis, and a change needs both axes disarmed.
[[nodiscard]] const wire::ParameterInfo* parameter_info(int index);
[[nodiscard]] std::uint8_t parameter_flags(int index);  // wire::ParameterFlag
[[nodiscard]] float parameter_value(const AxisSet& set, int index);

/// The first thing wrong with a set as a whole. An axis of which nothing was ever given is no mistake: it does not arm.
[[nodiscard]] wire::Answer check(const ParameterSet& set, const BoardRating& rating);

/// Of a save of so many. Payload: version, count, ids (two a word), values of axis 0, of axis 1.
constexpr std::size_t parameter_record_words(std::size_t saved) {
  return header_words + 2 + (saved + 1) / 2 + axis_count * saved;
}

class ParameterStore {
 public:
  static constexpr std::size_t slot_bytes = 1024;
  // Of what identify may find a motor has little, and a board stands still while it saves: five of them are saved, and
  // those that stand at their default are not.
  static constexpr int always_saved = parameter_count - found_count, most_saved = always_saved + 5;
  static constexpr std::size_t record_words = parameter_record_words(most_saved);
  static_assert(4 * record_words <= slot_bytes, "as many parameters as a slot holds");

  explicit ParameterStore(const BoardRating& rating) : rating_(rating) {
    in_force_.seal();
    staged_.seal();
  }

  const BoardRating& rating() const { return rating_; }

  /// Once, before the watchdogs run (it may erase): puts the saved set in force. What the answer refuses must not be
  /// driven: hand its finding to Driver::hold.
  template <hal::Store S>
  wire::Answer start(S& store) {
    log_.find(store);
    log_.make_room(store);
    wire::Answer answer = decode(in_force_.set);
    if (answer.status == 0) answer = check(in_force_.set, rating_);
    in_force_.seal();
    staged_ = in_force_;
    return answer;
  }

  const ParameterSet& in_force() const { return in_force_.set; }
  /// No bit of it has flipped.
  bool whole() const { return in_force_.whole(); }
  const ParameterSet& staged() const { return staged_.set; }

  /// The value in force.
  wire::Status get(const wire::Address& of, float& value) const;
  /// Into the staged set: the range counts, the rest is seen by commit. NaN takes a value back that has no default.
  wire::Answer stage(const wire::Assignment& one);
  /// Nothing is staged any more.
  void take_back() { staged_ = in_force_; }
  /// staged := in force, saved or defaults.
  wire::Answer load(wire::LoadFrom from);
  /// The staged set is checked as a whole and put in force. Refused: nothing has changed.
  wire::Answer commit(Driver& driver);

  /// What is in force goes to flash, record_words of it: up to 100 us of standstill each.
  template <hal::Store S>
  wire::Answer save(const Driver& driver, S& store) {
    const wire::Answer against = against_saving(driver);
    if (against.status != 0) return against;
    Record record;
    switch (log_.append(store, encode(record))) {
      case RecordLog::Written::done:
        return {};
      case RecordLog::Written::no_room:
        return wire::refused(wire::Status::no_room);
      default:
        return wire::refused(wire::Status::not_written);
    }
  }

  /// Number of the saved record; 0: there is none.
  std::uint32_t saved_serial() const { return log_.newest().payload.empty() ? 0 : log_.newest().serial; }
  bool unsaved() const;      // in force and saved differ
  bool uncommitted() const;  // staged and in force differ

 private:
  using Record = std::uint32_t[record_words];
  static constexpr std::uint32_t version = 1;

  /// They lie here for hours until a commit or a save: what flips in one meanwhile must become neither.
  struct Kept {
    ParameterSet set;
    std::uint32_t sum = 0;
    std::uint32_t sum_now() const;
    void seal() { sum = sum_now(); }
    bool whole() const { return sum == sum_now(); }
  };

  bool saved(int index) const;
  int saved_count() const;
  std::span<std::uint32_t> encode(Record& record) const;
  wire::Answer decode(ParameterSet& set) const;
  wire::Answer against_saving(const Driver& driver) const;

  BoardRating rating_;
  RecordLog log_{0x52415048, slot_bytes};  // "HPAR"
  Kept in_force_, staged_;
};

}  // namespace firmware
