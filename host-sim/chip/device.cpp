// SPDX-License-Identifier: MIT
#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

const Register* Device::find(std::uint32_t offset, unsigned size, const char* verb) {
  if (!clocked()) {
    trouble(std::string(verb) + " with its clock off (RCC enable bit missing)", offset);
    return nullptr;
  }
  if (offset % 4 != 0 || size != 4) {
    trouble(std::string(verb) + " that is not one aligned word", offset);
    return nullptr;
  }
  const std::size_t word = offset / 4;
  if (word >= index_.size() || index_[word] < 0) {
    trouble(std::string(verb) + " of a register that does not exist or is not modelled", offset);
    return nullptr;
  }
  return &map_[static_cast<std::size_t>(index_[word])];
}

std::uint32_t Device::read(std::uint32_t offset, unsigned size) {
  return find(offset, size, "read") ? on_read(offset) : 0;
}

void Device::write(std::uint32_t offset, std::uint32_t value, unsigned size) {
  const Register* r = find(offset, size, "write");
  if (!r) return;
  if ((value ^ r->reset) & ~r->exists) trouble(std::string("reserved bit of ") + r->name + " changed", offset);
  on_write(offset, value);
}

}  // namespace host_sim::chip
