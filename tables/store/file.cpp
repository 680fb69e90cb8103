#include "tables/store/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

class Descriptor {
  public:
    Descriptor(const std::string& path, int flags) : fd(::open(path.c_str(), flags | O_CLOEXEC)) {}
    ~Descriptor() {
        if (fd >= 0) ::close(fd);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    const int fd;
};

std::string reason() { return std::strerror(errno); }

}  // namespace

std::vector<unsigned char> read_file(const std::string& path, std::uint64_t most) {
    const Descriptor file(path, O_RDONLY);
    struct stat info = {};
    if (file.fd < 0 || ::fstat(file.fd, &info) != 0) throw Error("{}: cannot be read: {}", path, reason());
    if (!S_ISREG(info.st_mode)) throw Error("{}: expected a file, found something else", path);
    if (static_cast<std::uint64_t>(info.st_size) > most)
        throw Error("{}: expected at most {} bytes, found {}", path, most, info.st_size);
    std::vector<unsigned char> bytes(static_cast<std::size_t>(info.st_size));
    for (std::size_t done = 0; done < bytes.size();) {
        const ssize_t n = ::read(file.fd, bytes.data() + done, bytes.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) throw Error("{}: cannot be read: {}", path, n < 0 ? reason() : "it ended early");
        done += static_cast<std::size_t>(n);
    }
    return bytes;
}

std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> number{0};
    char host[65] = "host";
    ::gethostname(host, sizeof host - 1);
    return fmt::format("{}.tmp-{}-{}-{}", path, host, ::getpid(), number++);
}

PendingFile::PendingFile(std::string path, std::string temporary)
    : path_(std::move(path)), temporary_(temporary.empty() ? temporary_name(path_) : std::move(temporary)) {
    fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (fd_ < 0) throw Error("{}: cannot be written: {}", path_, reason());
}

PendingFile::~PendingFile() {
    if (fd_ >= 0) ::close(fd_);
    if (!committed_) ::unlink(temporary_.c_str());
}

void PendingFile::write(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const char*>(data);
    for (std::size_t done = 0; done < size;) {
        const ssize_t n = ::write(fd_, bytes + done, size - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) throw Error("{}: cannot be written: {}", path_, n < 0 ? reason() : "no byte was taken");
        done += static_cast<std::size_t>(n);
    }
}

void PendingFile::commit() {
    if (::fsync(fd_) != 0) throw Error("{}: could not be brought to disk: {}", path_, reason());
    if (::close(std::exchange(fd_, -1)) != 0) throw Error("{}: could not be closed: {}", path_, reason());
    if (::rename(temporary_.c_str(), path_.c_str()) != 0) throw Error("{}: cannot be written: {}", path_, reason());
    committed_ = true;
    sync_folder(folder_of(path_));
}

void write_file(const std::string& path, const void* data, std::size_t size) {
    PendingFile pending(path);
    pending.write(data, size);
    pending.commit();
}

void write_file(const std::string& path, const std::string& text) { write_file(path, text.data(), text.size()); }

void refuse_input(const std::string& output, const std::vector<std::string>& inputs) {
    for (const std::string& input : inputs) {
        std::error_code none;  // a file that is not there yet is no input
        if (std::filesystem::equivalent(output, input, none))
            throw Error("{}: expected another output than the input, found {}", output, input);
    }
}

void sync_folder(const std::string& path) {
    const Descriptor folder(path, O_RDONLY | O_DIRECTORY);
    if (folder.fd < 0 || ::fsync(folder.fd) != 0) throw Error("{}: could not be brought to disk: {}", path, reason());
}

std::string folder_of(const std::string& path) {
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    return folder.empty() ? "." : folder.string();
}

}  // namespace medulla::tables
