// The output of a program, checked before the work starts: a plain file is replaced atomically, a device or a pipe is
// written to directly.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace medulla::tables {

class Output {
  public:
    /// Follows symbolic links. Throws Error for an output that could not be written later: a folder, a block device or
    /// a socket; a missing or read-only folder; a name that is too long; a pipe without a reader; standard error, which
    /// is for messages; one of `inputs`. If it is standard output, everything printed goes to standard error from then
    /// on.
    explicit Output(std::string path, const std::vector<std::string>& inputs = {});
    ~Output();
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    /// As given by the user.
    const std::string& path() const { return path_; }

    /// Throws Error unless it is a plain or a new file; required if other files are stored beside it.
    void require_plain() const;

    /// Writes everything; call it once.
    /// @param temporary name of a plain file while it is written, used if it is on the same file system; empty: a name
    /// beside the output
    void write(const void* data, std::size_t size, const std::string& temporary = {}) const;
    void write(const std::string& text) const { write(text.data(), text.size()); }

  private:
    std::string path_, target_;  ///< target_: path_ with symbolic links resolved
    const char* kind_ = "plain file";
    int fd_ = -1;  ///< of an output that is written to directly
};

}  // namespace medulla::tables
