// SPDX-License-Identifier: MIT
#include "wire/pc/files.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

using wire::pc::write_whole;

std::string scratch(const std::string& name) { return (std::filesystem::temp_directory_path() / name).string(); }

TEST(Files, APlainFileIsReplacedWholeAndNothingIsLeftBeside) {
  const std::string path = scratch("folder/that/is/missing/answer.json");
  write_whole(path, "a longer first text");
  write_whole(path, "second");
  std::string text;
  std::getline(std::ifstream(path), text);
  EXPECT_EQ(text, "second");
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
}

TEST(Files, APipeIsWrittenToAndStaysAPipe) {
  const std::string path = scratch("pipe");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const int both_ends = open(path.c_str(), O_RDWR | O_NONBLOCK);
  write_whole(path, "text");
  char read_back[8] = {};
  EXPECT_EQ(read(both_ends, read_back, sizeof read_back), 4);
  EXPECT_STREQ(read_back, "text");
  EXPECT_TRUE(std::filesystem::is_fifo(path));
  close(both_ends);
}

TEST(Files, AFolderForResultsIsMadeOrRefusedBeforeTheWork) {
  const std::string path = scratch("made/of/three");
  wire::pc::need_folder(path);
  EXPECT_TRUE(std::filesystem::is_directory(path));
  write_whole(path + "/file", "text");
  EXPECT_THROW(wire::pc::need_folder(path + "/file"), wire::pc::UserError);
  EXPECT_THROW(wire::pc::need_folder("/proc/nowhere"), wire::pc::UserError);
}

TEST(Files, AFolderCannotBeWritten) {
  EXPECT_THROW(write_whole(std::filesystem::temp_directory_path().string(), "text"), wire::pc::UserError);
}

}  // namespace
