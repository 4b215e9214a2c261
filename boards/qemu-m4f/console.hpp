// SPDX-License-Identifier: MIT
// The one line out of the emulated machine, and its end. Semihosting on the target, stdout on the PC.
#pragma once

namespace console {

void write(const char* text);
[[noreturn]] void quit(int code);

/// Writes a number in decimal.
inline void write(unsigned value) {
  char digits[11];
  int at = 10;
  digits[at] = '\0';
  do {
    digits[--at] = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  write(digits + at);
}

/// Writes the low `nibbles` hexadecimal digits of a number.
inline void write_hex(unsigned long long value, int nibbles) {
  char digits[17];
  digits[nibbles] = '\0';
  for (int i = nibbles - 1; i >= 0; --i, value >>= 4) digits[i] = "0123456789abcdef"[value & 15];
  write(digits);
}

}  // namespace console
