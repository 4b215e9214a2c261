// SPDX-License-Identifier: MIT
#include "boards/host/usbip/transfers.hpp"

#include <algorithm>

namespace boards::usb {
namespace {

constexpr std::size_t packet = 64;  // endpoint 0 and bulk of this device; a shorter interrupt packet ends a read anyway
constexpr double bit_s = 1 / 12e6;  // full speed
constexpr double nak_s = 20e-6;     // a token, a NAK, and a controller that turns to other things
constexpr double idle_s = 250e-6;   // nobody asks for anything
constexpr std::size_t overhead_bytes = 13;  // of a bulk transaction, USB 2.0 table 5-9
constexpr int strikes = 3;                  // silences before the controller gives up, USB 2.0 10.2.6

std::uint16_t word(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return at + 1 < bytes.size() ? static_cast<std::uint16_t>(bytes[at] | bytes[at + 1] << 8) : std::uint16_t{0};
}

}  // namespace

void Transfers::pass(double seconds) {
  device_.run(seconds);
  time_s_ += seconds;
}

void Transfers::forget() {
  waiting_.clear();
  data1_.clear();
  finished_early_.clear();
  address_ = 0;
}

bool Transfers::cancel(std::uint32_t id) {
  for (auto& [where, queue] : waiting_) {
    const auto found = std::find_if(queue.begin(), queue.end(), [&](const Job& j) { return j.transfer.id == id; });
    if (found == queue.end()) continue;
    queue.erase(found);
    return true;
  }
  return false;
}

bool Transfers::end(Job& job, Outcome outcome) {
  job.transfer.outcome = outcome;
  return true;
}

/// Bus time, NAKs and silence are counted here for every transaction.
Answer Transfers::heard(Job& job, Answer answer, std::size_t bytes) {
  naks_ += answer.kind == Answer::nak;
  job.silent = answer.kind == Answer::none ? job.silent + 1 : 0;
  if (answer.kind == Answer::ack) pass(static_cast<double>((overhead_bytes + bytes + answer.bytes.size()) * 8) * bit_s);
  return answer;
}

bool Transfers::step_in(Job& job, bool& data1) {
  Transfer& t = job.transfer;
  const Answer answer = heard(job, device_.in(address_, t.endpoint), 0);
  if (answer.kind == Answer::stall) return end(job, Outcome::stalled);
  if (answer.kind != Answer::ack) return job.silent >= strikes && end(job, Outcome::gone);
  if (t.endpoint != 0 && answer.data1 != data1) {  // a repetition by rule: dropped
    ++toggle_errors_;
    return false;
  }
  data1 = !data1;
  if (answer.bytes.size() > t.wanted - t.bytes.size()) return end(job, Outcome::garbled);
  t.bytes.insert(t.bytes.end(), answer.bytes.begin(), answer.bytes.end());
  if (answer.bytes.size() < packet || t.bytes.size() == t.wanted) return end(job, Outcome::done);
  return false;
}

bool Transfers::step_out(Job& job, bool& data1) {
  Transfer& t = job.transfer;
  const std::size_t count = std::min(packet, t.bytes.size() - job.moved);
  const Answer answer =
      heard(job, device_.out(address_, t.endpoint, data1, std::span(t.bytes).subspan(job.moved, count)), count);
  if (answer.kind == Answer::stall) return end(job, Outcome::stalled);
  if (answer.kind != Answer::ack) return job.silent >= strikes && end(job, Outcome::gone);
  data1 = !data1;
  job.moved += count;
  return job.moved == t.bytes.size() && end(job, Outcome::done);
}

bool Transfers::step_control(Job& job) {
  Transfer& t = job.transfer;
  bool ended = false;
  switch (job.stage) {
    case Stage::setup:
      if (heard(job, device_.setup(address_, t.setup), 8).kind != Answer::ack)
        return job.silent >= strikes && end(job, Outcome::gone);
      job.data1 = true;
      job.stage = (t.in ? t.wanted : t.bytes.size()) ? Stage::data : Stage::status;
      return false;
    case Stage::data:
      ended = t.in ? step_in(job, job.data1) : step_out(job, job.data1);
      if (ended && t.outcome == Outcome::done) {
        job.stage = Stage::status;
        return false;
      }
      return ended;
    case Stage::status: {  // a zero-length packet the other way
      const bool to_device = t.in && t.wanted;
      const Answer answer = heard(job, to_device ? device_.out(address_, 0, true, {}) : device_.in(address_, 0), 0);
      if (answer.kind == Answer::stall) return end(job, Outcome::stalled);
      if (answer.kind != Answer::ack) return job.silent >= strikes && end(job, Outcome::gone);
      if (!answer.bytes.empty()) return end(job, Outcome::garbled);
      note_toggles(t);
      return end(job, Outcome::done);
    }
  }
  return true;
}

/// What resets toggles resets them on both sides (USB 2.0 9.1.1.5, 9.4.5).
void Transfers::note_toggles(const Transfer& t) {
  const std::uint8_t type = t.setup[0], request = t.setup[1];
  if (type == 0x00 && request == 5) address_ = t.setup[2];
  if (type == 0x00 && request == 9) data1_.clear();
  if (type == 0x02 && request == 1 && t.setup[2] == 0) data1_[t.setup[4]] = false;
  if (type == 0x01 && request == 11) {  // SET_INTERFACE: the endpoints between its descriptor and the next
    const auto& all = configuration_descriptor_;
    bool inside = false;
    for (std::size_t at = 0; at + 2 < all.size() && all[at] >= 2; at += all[at]) {
      if (all[at + 1] == 4) inside = all[at + 2] == t.setup[4];
      if (all[at + 1] == 5 && inside) data1_[all[at + 2]] = false;
    }
  }
}

bool Transfers::step(Job& job) {
  if (job.transfer.endpoint == 0) return step_control(job);
  bool& data1 = data1_[slot(job.transfer)];
  return job.transfer.in ? step_in(job, data1) : step_out(job, data1);
}

void Transfers::turn(std::vector<Transfer>& finished) {
  const double before_s = time_s_;
  bool work = false;
  finished.insert(finished.end(), finished_early_.begin(), finished_early_.end());
  finished_early_.clear();
  for (auto& [where, queue] : waiting_) {
    work = work || !queue.empty();
    if (queue.empty() || !step(queue.front())) continue;
    finished.push_back(std::move(queue.front().transfer));
    queue.pop_front();
  }
  if (time_s_ == before_s) pass(work ? nak_s : idle_s);
}

Transfer Transfers::wait_for(Transfer transfer, double patience_s) {
  const std::uint32_t id = transfer.id;
  const double until_s = time_s_ + patience_s;
  submit(transfer);
  std::vector<Transfer> finished, others;
  while (time_s_ < until_s) {
    turn(finished);
    for (Transfer& t : finished) {
      if (t.id == id)
        transfer = std::move(t), patience_s = 0;
      else
        others.push_back(std::move(t));
    }
    finished.clear();
    if (patience_s == 0) break;
  }
  finished_early_ = std::move(others);
  if (patience_s != 0) {
    cancel(id);
    transfer.outcome = Outcome::gone;
  }
  return transfer;
}

Transfer Transfers::control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                            std::uint16_t length, std::vector<std::uint8_t> data) {
  Transfer t;
  t.id = 0xFFFFFFFF;  // none of a client's
  t.in = (type & 0x80) != 0;
  const auto low = [](std::uint16_t v) { return static_cast<std::uint8_t>(v); };
  const auto high = [](std::uint16_t v) { return static_cast<std::uint8_t>(v >> 8); };
  t.setup = {type, request, low(value), high(value), low(index), high(index), low(length), high(length)};
  t.wanted = length;
  t.bytes = std::move(data);
  return wait_for(std::move(t));
}

bool Transfers::enumerate() {
  forget();
  for (int ms = 0; ms < 500 && !device_.attached(); ++ms) pass(1e-3);
  if (!device_.attached()) return false;
  device_.bus_reset();
  pass(20e-3);
  if (control(0x00, 5, 1, 0, 0).outcome != Outcome::done) return false;  // SET_ADDRESS
  pass(2e-3);                                                            // USB 2.0 9.2.6.3
  const Transfer device = control(0x80, 6, 0x0100, 0, 18);
  const Transfer head = control(0x80, 6, 0x0200, 0, 9);
  if (device.bytes.size() != 18 || head.bytes.size() != 9) return false;
  const Transfer configuration = control(0x80, 6, 0x0200, 0, word(head.bytes, 2));
  device_descriptor_ = device.bytes;
  configuration_descriptor_ = configuration.bytes;
  serial_.clear();
  if (const std::uint8_t text = device.bytes[16]; text != 0) {  // iSerialNumber, USB 2.0 table 9-8
    const Transfer serial = control(0x80, 6, static_cast<std::uint16_t>(0x0300 | text), 0x0409, 255);
    for (std::size_t i = 2; i + 1 < serial.bytes.size(); i += 2) {
      const std::uint16_t letter = word(serial.bytes, i);
      serial_ += letter >= ' ' && letter <= '~' ? static_cast<char>(letter) : '?';
    }
  }
  return configuration.bytes.size() >= head.bytes.size() && configuration.bytes.size() == word(head.bytes, 2);
}

}  // namespace boards::usb
