// A folder of this process in the system's temporary directory, removed with everything in it.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

namespace medulla::test {

class TemporaryFolder {
  public:
    TemporaryFolder() { std::filesystem::create_directories(path_); }
    ~TemporaryFolder() { std::filesystem::remove_all(path_); }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    const std::filesystem::path& path() const { return path_; }
    std::string operator/(const std::string& name) const { return path_ / name; }

  private:
    std::filesystem::path path_ =
        std::filesystem::temp_directory_path() / ("medulla_test_" + std::to_string(::getpid()));
};

}  // namespace medulla::test
