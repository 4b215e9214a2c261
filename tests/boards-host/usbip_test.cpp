// SPDX-License-Identifier: MIT
// The USB/IP server against its protocol (Linux, Documentation/usb/usbip_protocol.rst) and against clients that break
// it. The device is a toy: it echoes endpoint 1, and endpoint 0 knows its descriptors and one request that stalls.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <deque>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "boards/host/usbip/server.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::usb {
namespace {

using Bytes = std::vector<std::uint8_t>;

class Toy final : public Device {
 public:
  void plug(bool in) override {
    in_ = in;
    if (!in) echo_.clear();
  }
  bool attached() const override { return in_; }
  void bus_reset() override { address_ = 0; }
  Answer setup(unsigned address, const std::array<std::uint8_t, 8>& r) override {
    if (address != address_ || dead) return {};
    answer_.clear();
    stall_ = false;
    const std::size_t length = static_cast<std::size_t>(r[6] | r[7] << 8);
    if (r[0] == 0x00 && r[1] == 5) next_ = r[2];
    if (r[0] == 0x80 && r[1] == 6 && r[3] == 1) answer_ = {18, 1, 1, 2, 0, 0, 0, 64, 9, 0x12, 1, 0, 0, 1, 0, 0, 3, 1};
    if (r[0] == 0x80 && r[1] == 6 && r[3] == 3 && r[2] == 3) answer_ = serial;
    if (r[0] == 0x80 && r[1] == 6 && r[3] == 2) answer_ = configuration;
    if (r[0] == 0xC0) stall_ = true;
    if (answer_.size() > length) answer_.resize(length);
    return {Answer::ack};
  }
  Answer out(unsigned address, int endpoint, bool, std::span<const std::uint8_t> bytes) override {
    if (address != address_ || endpoint > 1 || dead) return {};
    if (endpoint == 1) {
      if (echo_.size() > 4096) return {Answer::nak};
      echo_.insert(echo_.end(), bytes.begin(), bytes.end());
    }
    return {Answer::ack};
  }
  Answer in(unsigned address, int endpoint) override {
    if (address != address_ || endpoint > 1 || dead) return {};
    if (endpoint == 0) {
      if (stall_) return {Answer::stall};
      address_ = next_;
      return {Answer::ack, true, std::exchange(answer_, {})};
    }
    if (echo_.empty()) return {Answer::nak};
    Answer a{Answer::ack, toggle_};
    toggle_ = !toggle_;
    while (!echo_.empty() && a.bytes.size() < 64) {
      a.bytes.push_back(echo_.front());
      echo_.pop_front();
    }
    return a;
  }
  void run(double) override {}
  void power_cycle() override { in_ = false, ++power_cycles; }

  std::atomic<bool> dead{false};  // silent from now on
  std::atomic<int> power_cycles = 0;
  Bytes configuration{9, 2, 32, 0, 1, 1, 0,  0xC0, 0, 9, 4, 0,    0, 2,  0xFF, 0,
                      0, 0, 7,  5, 1, 2, 64, 0,    0, 7, 5, 0x81, 2, 64, 0,    0};
  Bytes serial{8, 3, 'T', 0, 7, 0, 0x61, 0x21};  // the second and third letter are not printable

 private:
  std::atomic<bool> in_ = false;
  bool stall_ = false, toggle_ = false;
  unsigned address_ = 0, next_ = 0;
  Bytes answer_;
  std::deque<std::uint8_t> echo_;
};

struct UsbIp : ::testing::Test {
  UsbIp() : thread([this] { server.serve([this] { return stop.load(); }); }) {}
  ~UsbIp() override {
    stop = true;
    thread.join();
  }
  Toy toy;
  Server server{toy, 0};
  std::atomic<bool> stop{false};
  std::thread thread;
};

struct Client {
  explicit Client(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in where{};
    where.sin_family = AF_INET;
    where.sin_port = htons(port);
    where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{5, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    connected = connect(socket_, reinterpret_cast<sockaddr*>(&where), sizeof where) == 0;
  }
  ~Client() {
    if (socket_ >= 0) close(socket_);
  }
  bool say(const Bytes& bytes) { return send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) >= 0; }
  /// Fewer than asked: the other side hung up.
  Bytes hear(std::size_t bytes) {
    Bytes all(bytes);
    std::size_t at = 0;
    while (at < bytes) {
      const ssize_t got = recv(socket_, all.data() + at, bytes - at, 0);
      if (got <= 0) break;
      at += static_cast<std::size_t>(got);
    }
    all.resize(at);
    return all;
  }
  /// Ends with a reset of the connection instead of a farewell.
  void crash() {
    const linger at_once{1, 0};
    setsockopt(socket_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close(std::exchange(socket_, -1));
  }
  /// Hung up by the other side, and not merely silent.
  bool cut_off() {
    std::uint8_t byte;
    const ssize_t got = recv(socket_, &byte, 1, 0);
    return got == 0 || (got < 0 && errno == ECONNRESET);
  }
  std::uint32_t import(const char* id = "1-1") {
    Bytes request = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0};
    for (std::size_t i = 0; i < 32; ++i) request.push_back(static_cast<std::uint8_t>(i < 3 ? id[i] : 0));
    say(request);
    const Bytes head = hear(8);
    if (head.size() != 8) return 99;
    if (head[7] == 0) device = hear(312);
    return head[7];
  }
  bool connected;
  Bytes device;

 private:
  int socket_;
};

void put(Bytes& b, std::uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) b.push_back(static_cast<std::uint8_t>(v >> shift));
}
std::uint32_t get(const Bytes& b, std::size_t at) {
  return static_cast<std::uint32_t>(b[at]) << 24 | static_cast<std::uint32_t>(b[at + 1]) << 16 |
         static_cast<std::uint32_t>(b[at + 2]) << 8 | b[at + 3];
}
Bytes submit(std::uint32_t sequence, std::uint32_t endpoint, bool in, std::uint32_t length, const Bytes& data = {},
             const Bytes& setup = Bytes(8)) {
  Bytes b;
  for (const std::uint32_t v : {1u, sequence, 0x10002u, in ? 1u : 0u, endpoint, 0u, length, 0u, 0u, 0u}) put(b, v);
  b.insert(b.end(), setup.begin(), setup.end());
  b.insert(b.end(), data.begin(), data.end());
  return b;
}
Bytes unlink(std::uint32_t sequence, std::uint32_t which) {
  Bytes b;
  for (const std::uint32_t v : {2u, sequence, 0x10002u, 0u, 0u, which}) put(b, v);
  b.resize(48);
  return b;
}

TEST_F(UsbIp, ListsAndImportsItsOneDevice) {
  EXPECT_EQ(server.serial(), "T??");
  Client list(server.port());
  list.say({0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0});
  const Bytes answer = list.hear(12 + 312 + 4);
  ASSERT_EQ(answer.size(), 328u);
  EXPECT_EQ(get(answer, 0), 0x01110005u);
  EXPECT_EQ(get(answer, 8), 1u) << "one device";
  EXPECT_STREQ(reinterpret_cast<const char*>(&answer[12 + 256]), "1-1");
  EXPECT_EQ(get(answer, 12 + 296), 2u) << "full speed";
  EXPECT_EQ(get(answer, 12 + 300), 0x12090001u);
  EXPECT_EQ(get(answer, 12 + 312), 0xFF000000u) << "its interface: a vendor's class";
  Client first(server.port()), second(server.port()), other(server.port());
  EXPECT_EQ(first.import(), 0u);
  EXPECT_EQ(get(first.device, 300), 0x12090001u);
  EXPECT_EQ(second.import(), 2u) << "one client has it: busy";
  EXPECT_EQ(other.import("2-1"), 1u) << "no such device";
}

TEST_F(UsbIp, TheListNamesInterfacesAsTheDeviceDescribesThemAndNoneTwice) {
  const Bytes head = {9, 2, 0, 0, 3, 1, 0, 0xC0, 0}, first = {9, 4, 0, 0, 0, 0xFF, 1, 2, 0},
              again = {9, 4, 0, 1, 0, 0xFE, 0, 0, 0}, second = {9, 4, 1, 0, 0, 2, 2, 0, 0};
  const auto listed = [&](const std::vector<Bytes>& parts) {
    Bytes all = head;
    for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
    all[2] = static_cast<std::uint8_t>(all.size());
    toy.configuration = all;
    Client c(server.port());
    for (int i = 0; i < 100 && c.import() != 0; ++i) usleep(2000);  // which looks at the device anew
    Client list(server.port());
    list.say({0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0});
    const Bytes answer = list.hear(12 + 312 + 3 * 4);
    return answer.size() == 336 ? Bytes(answer.begin() + 324, answer.end()) : Bytes();
  };
  const Bytes one_of_three = {0xFF, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(listed({first, again, second}), (Bytes{0xFF, 1, 2, 0, 2, 2, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(listed({first, {0, 4}, second}), one_of_three) << "a descriptor without a length ends the list";
  EXPECT_EQ(listed({first, {250, 4}, {0}}), one_of_three) << "one that is longer than what there is, too";
  EXPECT_EQ(listed({first, second, first, again, second}), (Bytes{0xFF, 1, 2, 0, 2, 2, 0, 0, 0xFF, 1, 2, 0}));
}

TEST_F(UsbIp, AClientThatNeverReadsIsCutOff) {
  Client c(server.port());
  Bytes questions;
  for (int i = 0; i < 1000; ++i) questions.insert(questions.end(), {0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0});
  int said = 0;
  for (; said < 5000 && c.say(questions); ++said) usleep(1000);
  EXPECT_LT(said, 5000) << "each answer has 328 B, and only so many are kept";
  Client next(server.port());
  EXPECT_EQ(next.import(), 0u);
}

TEST_F(UsbIp, AClientThatCrashesIsAPulledCable) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.crash();
  std::uint32_t status = 2;
  for (int i = 0; i < 200 && status == 2; ++i) {
    usleep(2000);
    status = Client(server.port()).import();
  }
  EXPECT_EQ(status, 0u);
}

TEST_F(UsbIp, CarriesControlAndBulkTransfersAndStalls) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.say(submit(1, 0, true, 18, {}, {0x80, 6, 0, 1, 0, 0, 18, 0}));
  Bytes answer = c.hear(48 + 18);
  ASSERT_EQ(answer.size(), 66u);
  EXPECT_EQ(get(answer, 0), 3u);
  EXPECT_EQ(get(answer, 4), 1u);
  EXPECT_EQ(get(answer, 20), 0u);
  EXPECT_EQ(get(answer, 24), 18u);
  EXPECT_EQ(answer[48], 18);
  c.say(submit(2, 0, true, 64, {}, {0xC0, 1, 0, 0, 0, 0, 64, 0}));
  EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EPIPE);
  Bytes data(300);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(i);
  c.say(submit(3, 1, false, 300, data));
  answer = c.hear(48);
  EXPECT_EQ(get(answer, 24), 300u);
  c.say(submit(4, 1, true, 512));
  answer = c.hear(48 + 300);
  ASSERT_EQ(answer.size(), 348u);
  EXPECT_TRUE(std::equal(data.begin(), data.end(), answer.begin() + 48));
}

TEST_F(UsbIp, AnUnlinkedReadIsGoneAndALateUnlinkSaysSo) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.say(submit(7, 1, true, 64));  // nothing to read: it waits
  c.say(unlink(8, 7));
  Bytes answer = c.hear(48);
  EXPECT_EQ(get(answer, 0), 4u);
  EXPECT_EQ(get(answer, 4), 8u);
  EXPECT_EQ(static_cast<int>(get(answer, 20)), -ECONNRESET);
  c.say(unlink(9, 7));
  answer = c.hear(48);
  EXPECT_EQ(get(answer, 4), 9u);
  EXPECT_EQ(get(answer, 20), 0u);
}

TEST_F(UsbIp, AClosedConnectionIsAPulledCableAndTheNextClientFindsACleanDevice) {
  for (int round = 0; round < 20; ++round) {
    Client c(server.port());
    std::uint32_t status = c.import();
    for (int i = 0; i < 100 && status == 2; ++i) {  // the last one's end is noticed within milliseconds
      Client again(server.port());
      usleep(2000);
      status = c.import();
    }
    ASSERT_EQ(status, 0u) << round;
    c.say(submit(1, 1, false, 3, {1, 2, 3}));  // left in the middle of it
  }
}

TEST_F(UsbIp, ADeviceThatLeavesTheBusClosesItsConnectionAndMayComeBack) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.say(submit(1, 1, true, 64));
  toy.power_cycle();
  EXPECT_TRUE(c.cut_off());
  Client again(server.port());
  EXPECT_EQ(again.import(), 0u);
}

TEST_F(UsbIp, WhoBreaksTheProtocolIsCutOffAndNobodyElse) {
  Client good(server.port());
  ASSERT_EQ(good.import(), 0u);
  const Bytes wrong_version = {0x01, 0x06, 0x80, 0x05, 0, 0, 0, 0}, no_operation = {0x01, 0x11, 0x80, 0x77, 0, 0, 0, 0};
  for (const Bytes& opening : {wrong_version, no_operation}) {
    Client bad(server.port());
    bad.say(opening);
    EXPECT_TRUE(bad.cut_off());
  }
  good.say(submit(5, 0, true, 18, {}, {0x80, 6, 0, 1, 0, 0, 18, 0}));
  EXPECT_EQ(good.hear(66).size(), 66u);
}

TEST_F(UsbIp, AbsurdLengthsEndpointsAndRepeatedNumbersEndTheConnection) {
  const Bytes nonsense[] = {submit(1, 1, true, 0xFFFFFFFF),
                            submit(1, 99, true, 64),
                            [] {
                              Bytes b = submit(1, 1, true, 64);
                              b[3] = 7;  // no such command
                              return b;
                            }(),
                            [] {
                              Bytes b = submit(1, 1, true, 64);
                              b[15] = 2;  // neither in nor out
                              return b;
                            }(),
                            [] {
                              Bytes b = submit(1, 1, true, 64);
                              b[35] = 4;  // four isochronous packets
                              return b;
                            }(),
                            [] {
                              Bytes b = submit(1, 1, true, 64), again = b;
                              b.insert(b.end(), again.begin(), again.end());
                              return b;
                            }()};
  for (const Bytes& message : nonsense) {
    Client c(server.port());
    for (int i = 0; i < 100 && c.import() != 0; ++i) usleep(2000);
    c.say(message);
    EXPECT_TRUE(c.cut_off());
  }
}

TEST_F(UsbIp, AControlTransferThatContradictsItselfStalls) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.say(submit(1, 0, true, 18, {}, {0x80, 6, 0, 1, 0, 0, 64, 0}));  // 18 bytes, says 64
  EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EPIPE);
  c.say(submit(2, 0, false, 2, {0, 0}, {0x80, 6, 0, 1, 0, 0, 2, 0}));  // OUT that says IN
  EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EPIPE);
  c.say(submit(3, 0, true, 2, {}, {0x00, 6, 0, 1, 0, 0, 2, 0}));  // IN that says OUT
  EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EPIPE);
}

TEST_F(UsbIp, AMessageMayComeInPieces) {
  Client c(server.port());
  const Bytes import = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
  c.say(Bytes(import.begin(), import.begin() + 8));
  usleep(5000);
  c.say(Bytes(import.begin() + 8, import.end()));
  c.say(Bytes(29));
  EXPECT_EQ(c.hear(320).size(), 320u);
  const Bytes command = submit(1, 1, false, 3, {1, 2, 3});
  for (const std::uint8_t byte : command) {
    c.say({byte});
    usleep(200);
  }
  EXPECT_EQ(get(c.hear(48), 24), 3u);
  const Bytes late = submit(2, 1, false, 3, {1, 2, 3});
  c.say(Bytes(late.begin(), late.end() - 2));
  usleep(20000);
  c.say(Bytes(late.end() - 2, late.end()));
  EXPECT_EQ(get(c.hear(48), 24), 3u);
}

TEST_F(UsbIp, AReadThatIsTooSmallForItsPacketSaysOverflow) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  c.say(submit(1, 1, false, 3, {1, 2, 3}));
  c.hear(48);
  c.say(submit(2, 1, true, 2));
  EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EOVERFLOW);
}

TEST_F(UsbIp, ADeviceThatFallsSilentIsAProtocolErrorAndNobodyImportsIt) {
  {
    Client c(server.port());
    ASSERT_EQ(c.import(), 0u);
    toy.dead = true;
    c.say(submit(1, 1, true, 64));
    EXPECT_EQ(static_cast<int>(get(c.hear(48), 20)), -EPROTO);
  }
  std::uint32_t status = 2;
  for (int i = 0; i < 200 && status == 2; ++i) {  // the server notices that the first client left
    usleep(5000);
    status = Client(server.port()).import();
  }
  EXPECT_EQ(status, 3u);
}

TEST_F(UsbIp, MoreReadsThanAKernelKeepsEndTheConnection) {
  Client c(server.port());
  ASSERT_EQ(c.import(), 0u);
  Bytes many;
  for (std::uint32_t i = 1; i <= 257; ++i) {
    Bytes one = submit(i, 1, true, 64);
    std::fill_n(one.begin() + 32, 4, std::uint8_t{0xFF});  // no isochronous packets, as some kernels say it
    many.insert(many.end(), one.begin(), one.end());
  }
  c.say(Bytes(many.begin(), many.end() - 48));
  c.say(unlink(300, 256));
  EXPECT_EQ(get(c.hear(48), 4), 300u) << "256 of them wait";
  c.say(submit(256, 1, true, 64));
  c.say(Bytes(many.end() - 48, many.end()));
  EXPECT_TRUE(c.cut_off());
}

TEST_F(UsbIp, AFifthClientIsTurnedAway) {
  Client four[4] = {Client(server.port()), Client(server.port()), Client(server.port()), Client(server.port())};
  for (Client& c : four) EXPECT_EQ(c.import("9-9"), 1u);  // each of them was let in
  EXPECT_TRUE(Client(server.port()).cut_off());
}

TEST_F(UsbIp, RandomBytesDoNotBringItDown) {
  std::mt19937 random(3);
  for (int round = 0; round < 300; ++round) {
    Client c(server.port());
    ASSERT_TRUE(c.connected);
    if (round % 2) c.import();
    Bytes noise(random() % 400);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random() % (random() % 4 ? 4 : 256));
    c.say(noise);
  }
  Client last(server.port());
  std::uint32_t status = 2;
  for (int i = 0; i < 200 && (status = last.import()) != 0; ++i) usleep(5000);
  EXPECT_EQ(status, 0u);
}

TEST(UsbIpServer, SaysThatItsPortIsTaken) {
  Toy a, b;
  Server first(a, 0);
  try {
    Server second(b, first.port());
    FAIL() << "two on one port";
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.exit_code(), static_cast<int>(wire::pc::Exit::busy));
    EXPECT_NE(std::string(error.what()).find("is taken by another program: choose another with --port"),
              std::string::npos);
  }
}

TEST(UsbIpServer, SaysWhereItServesCutsThePowerOnAHangUpAndEndsOnCtrlC) {
  Toy toy;
  std::thread person([&] {
    struct sigaction now {};
    while (sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler == SIG_DFL) usleep(1000);
    kill(getpid(), SIGHUP);
    while (toy.power_cycles == 0) usleep(1000);
    kill(getpid(), SIGINT);
  });
  ::testing::internal::CaptureStdout();
  EXPECT_EQ(serve_until_interrupted(toy, 0, false), 0);
  const std::string text = ::testing::internal::GetCapturedStdout();
  person.join();
  EXPECT_EQ(toy.power_cycles, 1);
  EXPECT_NE(text.find("usbip --tcp-port "), std::string::npos) << text;
  EXPECT_NE(text.find("attach -r 127.0.0.1 -b 1-1"), std::string::npos) << text;
  ::testing::internal::CaptureStdout();
  EXPECT_EQ(serve_until_interrupted(toy, 0, true), 0) << "Ctrl-C was pressed: it says where, and ends";
  const auto served = nlohmann::json::parse(::testing::internal::GetCapturedStdout(), nullptr, false);
  EXPECT_EQ(served["bus_id"], "1-1");
  EXPECT_EQ(served["serial"], "T??");
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);
}

TEST(UsbIpServer, SaysThatTheBoardDoesNotAnswer) {
  Toy toy;
  toy.dead = true;
  try {
    Server server(toy, 0);
    FAIL() << "it serves nothing";
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.exit_code(), static_cast<int>(wire::pc::Exit::no_board));
  }
}

}  // namespace
}  // namespace boards::usb
