#include "tables/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

class Descriptor {
  public:
    Descriptor(const std::string& path, int flags) : fd(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
    ~Descriptor() {
        if (fd >= 0) ::close(fd);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    const int fd;
};

std::string reason() { return std::strerror(errno); }

void sync(const std::string& path, int flags) {
    const Descriptor file(path, flags);
    if (file.fd < 0 || ::fsync(file.fd) != 0) throw Error("{}: could not be brought to disk: {}", path, reason());
}

}  // namespace

std::vector<unsigned char> read_file(const std::string& path) {
    const Descriptor file(path, O_RDONLY);
    struct stat info = {};
    if (file.fd < 0 || ::fstat(file.fd, &info) != 0) throw Error("{}: cannot be read: {}", path, reason());
    if (!S_ISREG(info.st_mode)) throw Error("{}: expected a file, found something else", path);
    std::vector<unsigned char> bytes(static_cast<std::size_t>(info.st_size));
    for (std::size_t done = 0; done < bytes.size();) {
        const ssize_t n = ::read(file.fd, bytes.data() + done, bytes.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) throw Error("{}: cannot be read: {}", path, n < 0 ? reason() : "it ended early");
        done += static_cast<std::size_t>(n);
    }
    return bytes;
}

PendingFile::PendingFile(std::string path)
    : path_(std::move(path)), temporary_(fmt::format("{}.tmp{}", path_, ::getpid())) {
    const Descriptor file(temporary_, O_WRONLY | O_CREAT | O_TRUNC);
    if (file.fd < 0) throw Error("{}: cannot be written: {}", path_, reason());
}

PendingFile::~PendingFile() {
    if (!committed_) ::unlink(temporary_.c_str());
}

void PendingFile::commit() {
    sync(temporary_, O_RDONLY);
    if (::rename(temporary_.c_str(), path_.c_str()) != 0) throw Error("{}: cannot be written: {}", path_, reason());
    committed_ = true;
    const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
    sync(folder.empty() ? "." : folder.string(), O_RDONLY | O_DIRECTORY);
}

void write_file(const std::string& path, const void* data, std::size_t size) {
    PendingFile pending(path);
    {
        const Descriptor file(pending.temporary(), O_WRONLY | O_TRUNC);
        const auto* bytes = static_cast<const char*>(data);
        for (std::size_t done = 0; done < size;) {
            const ssize_t n = file.fd < 0 ? -1 : ::write(file.fd, bytes + done, size - done);
            if (n < 0 && errno == EINTR && file.fd >= 0) continue;
            if (n <= 0) throw Error("{}: cannot be written: {}", path, reason());
            done += static_cast<std::size_t>(n);
        }
    }
    pending.commit();
}

void write_file(const std::string& path, const std::string& text) { write_file(path, text.data(), text.size()); }

}  // namespace medulla::tables
