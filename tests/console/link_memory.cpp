// SPDX-License-Identifier: MIT
// Memory that the link takes after its start, on real libusb: exchanges setpoint and state with the only board on the
// bus, and counts operator new anywhere and calloc by libusb. Exit code 1: our side took some.
//
//   umockdev-wrapper mocked_bus link_memory
#include <dlfcn.h>
#include <fmt/format.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include "console/link/board.hpp"
#include "console/link/messages.hpp"
#include "console/link/usb.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {
std::atomic<int> ours{0}, of_libusb{0};
std::atomic<bool> looks{false};
}  // namespace

[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++ours;
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

// glibc lets a program put its own in place of this one, for every library.
extern "C" void* __libc_calloc(std::size_t count, std::size_t bytes);
extern "C" [[gnu::noinline]] void* calloc(std::size_t count, std::size_t bytes) {
  if (looks) {
    looks = false;  // dladdr may want some itself
    Dl_info who{};
    if (dladdr(__builtin_return_address(0), &who) != 0 && std::strstr(who.dli_fname, "libusb-1.0") != nullptr)
      ++of_libusb;
    looks = true;
  }
  return __libc_calloc(count, bytes);
}

namespace {
int count() {
  console::link::Usb usb;
  console::link::Board board(usb.open(""));
  const wire::Setpoints wish{3, {}, 0, {0, 0}, {0, 0}};
  const auto exchange = [&](int times) {
    int states = 0;
    for (int i = 0; i < times && !board.gone(); ++i) {
      board.write(wire::Kind::setpoint, console::link::bytes_of(wish));
      for (bool answered = false; !answered && !board.gone();) {
        board.wait(10);
        while (const wire::Frame* frame = board.read()) answered = answered || console::link::state_in(*frame);
      }
      ++states;
    }
    return states;
  };
  exchange(10);  // whatever is made when it is first needed
  const int before = ours;
  looks = true;
  const int states = exchange(500);
  looks = false;
  const int taken = ours - before;
  fmt::print("{} exchanges: {} blocks by operator new, {} by calloc of libusb\n", states, taken, of_libusb.load());
  return states == 500 && taken == 0 ? 0 : 1;
}
}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Memory that the link takes after its start, on the only board on the bus\n"
      "\n"
      "Examples\n"
      "  umockdev-wrapper mocked_bus link_memory\n"
      "Exit codes: 0 none, 1 some of ours, 2 the command line is wrong, 4 no board.\n"};
  wire::pc::use_help(app, "link_memory");
  return wire::pc::run_program(app, argc, argv, count);
}
