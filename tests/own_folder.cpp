// SPDX-License-Identifier: MIT
// Tests run side by side, a process each: every process writes its files into a folder of its own.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <string>

namespace {

class OwnFolder : public ::testing::Environment {
 public:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "hotcore_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr) << name;
    folder_ = name;
    setenv("TMPDIR", folder_.c_str(), 1);
    setenv("TEST_TMPDIR", folder_.c_str(), 1);  // what GoogleTest's TempDir asks for
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

 private:
  std::filesystem::path folder_;
};

const auto* const own_folder = ::testing::AddGlobalTestEnvironment(new OwnFolder);

}  // namespace
