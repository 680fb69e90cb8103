// Whole files, safely: read into memory, and replaced in one step (temporary name, fsync, rename, fsync of the folder).
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

/// All bytes of a file; throws Error that names it.
std::vector<unsigned char> read_file(const std::string& path);

/// A file that appears under its name only when commit() is called, whole and on disk; otherwise nothing is left.
class PendingFile {
  public:
    explicit PendingFile(std::string path);
    ~PendingFile();
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;

    const std::string& temporary() const { return temporary_; }
    void commit();

  private:
    std::string path_, temporary_;
    bool committed_ = false;
};

void write_file(const std::string& path, const void* data, std::size_t size);
void write_file(const std::string& path, const std::string& text);

}  // namespace medulla::tables
