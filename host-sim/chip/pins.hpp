// SPDX-License-Identifier: MIT
// Pins of the LQFP64: GPIO ports A, B, C, D and H (RM0090 chapter 8), SYSCFG's choice of interrupt lines (chapter 9)
// and EXTI (chapter 12). A pin out of reset floats; a peripheral reaches a pin only through MODER and AFR.
#pragma once

#include <array>
#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

enum class PinMode { input = 0, output = 1, alternate = 2, analog = 3 };

struct Pin {
  char port;  // 'A'..'H'
  int number;
  friend bool operator==(const Pin&, const Pin&) = default;
};

class Exti;

class Gpio : public Device {
 public:
  enum : std::uint32_t {
    moder = 0x00,
    otyper = 0x04,
    ospeedr = 0x08,
    pupdr = 0x0C,
    idr = 0x10,
    odr = 0x14,
    bsrr = 0x18,
    lckr = 0x1C,
    afrl = 0x20,
    afrh = 0x24
  };
  Gpio(Host& host, char port, std::function<void(char, int, bool)> edge);

  PinMode mode(int pin) const { return static_cast<PinMode>(field(peek(moder), 2 * pin, 2)); }
  unsigned alternate(int pin) const { return field(peek(pin < 8 ? afrl : afrh), 4 * (pin % 8), 4); }
  bool is_alternate(int pin, unsigned af) const { return mode(pin) == PinMode::alternate && alternate(pin) == af; }
  bool drives_high(int pin) const { return mode(pin) == PinMode::output && (peek(odr) >> pin & 1); }
  unsigned pull(int pin) const { return field(peek(pupdr), 2 * pin, 2); }
  bool level(int pin) const { return levels_ >> pin & 1; }
  void set_level(int pin, bool high);  // what the outside world does to it

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  char port_;
  std::uint32_t levels_ = 0;
  std::function<void(char, int, bool)> edge_;
};

class Syscfg : public Device {
 public:
  static constexpr std::uint32_t address = 0x40013800;
  explicit Syscfg(Host& host);
  char port_of_line(int line) const;
};

class Exti : public Device {
 public:
  static constexpr std::uint32_t address = 0x40013C00;
  enum : std::uint32_t { imr = 0x00, emr = 0x04, rtsr = 0x08, ftsr = 0x0C, swier = 0x10, pr = 0x14 };
  explicit Exti(Host& host);
  void edge(int line, bool rising);
  void reset() override;

 protected:
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  void lines();
};

}  // namespace host_sim::chip
