// SPDX-License-Identifier: MIT
#include "console/link/board.hpp"

namespace console::link {

std::optional<std::uint8_t> Board::write(std::uint8_t kind, std::span<const std::uint8_t> payload) {
  if (payload.size() > wire::max_payload) return {};
  const wire::Frame frame{kind, sequence_, static_cast<std::uint16_t>(payload.size()), payload.data()};
  const std::size_t bytes = wire::encode(frame, out_.data(), out_.size());
  if (!transport_->write({out_.data(), bytes})) return {};
  return sequence_++;
}

const wire::Frame* Board::read() {
  if (in_at_ == in_end_) {
    transport_->wait(0);
    in_at_ = 0;
    in_end_ = transport_->read(in_);
  }
  while (in_at_ < in_end_) {
    if (reader_.take(in_[in_at_++])) return &reader_.frame();
  }
  return nullptr;
}

}  // namespace console::link
