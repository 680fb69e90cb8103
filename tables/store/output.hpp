// Where a program's product goes, checked before the work starts: a plain file is replaced in one step, a device or a
// pipe is written to as what it is.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace medulla::tables {

class Output {
  public:
    /// Follows symbolic links. Throws Error for what could not be written in the end: a folder, a block device or a
    /// socket; a folder around it that is missing or cannot be written; a name that is too long; a pipe that nobody
    /// reads; standard error, where messages go; one of `inputs`. Where it is standard output itself, all that is
    /// printed goes to standard error from now on.
    explicit Output(std::string path, const std::vector<std::string>& inputs = {});
    ~Output();
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    /// As the user wrote it.
    const std::string& path() const { return path_; }

    /// Throws Error unless it is a plain file, or will be one: where something is kept beside it.
    void require_plain() const;

    /// Once: all of it. `temporary`: name of a plain file while it is written, used where it is on the same file
    /// system; empty: one beside it.
    void write(const void* data, std::size_t size, const std::string& temporary = {}) const;
    void write(const std::string& text) const { write(text.data(), text.size()); }

  private:
    std::string path_, target_;  ///< target_: without symbolic links
    const char* kind_ = "plain file";
    int fd_ = -1;  ///< of what is not replaced
};

}  // namespace medulla::tables
