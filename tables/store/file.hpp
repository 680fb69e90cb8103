// Whole files, safely: read into memory, and replaced in one step (temporary name, fsync, rename, fsync of the folder).
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace medulla::tables {

/// All bytes of a file; throws Error that names it, also where it holds more than `most` bytes.
std::vector<unsigned char> read_file(const std::string& path,
                                     std::uint64_t most = std::numeric_limits<std::uint64_t>::max());

/// `<path>.tmp-<host>-<process>-<number>`: no two processes of a cluster make the same one.
std::string temporary_name(const std::string& path);

/// A file that appears under its name only when commit() is called, whole and on disk; otherwise nothing is left.
class PendingFile {
  public:
    /// Makes the temporary file; by default beside `path`, always on its file system.
    explicit PendingFile(std::string path, std::string temporary = {});
    ~PendingFile();
    PendingFile(const PendingFile&) = delete;
    PendingFile& operator=(const PendingFile&) = delete;

    const std::string& temporary() const { return temporary_; }
    void write(const void* data, std::size_t size);
    void commit();

  private:
    std::string path_, temporary_;
    int fd_ = -1;
    bool committed_ = false;
};

void write_file(const std::string& path, const void* data, std::size_t size);
void write_file(const std::string& path, const std::string& text);

/// Throws Error if `output` is one of the files that are read: nothing is written over an input.
void refuse_input(const std::string& output, const std::vector<std::string>& inputs);

/// Brings a folder's list of names to disk. Throws Error.
void sync_folder(const std::string& path);

/// Folder of a path: "." where it names none.
std::string folder_of(const std::string& path);

}  // namespace medulla::tables
