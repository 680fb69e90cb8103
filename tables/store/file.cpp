#include "tables/store/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "tables/error.hpp"
#include "tables/streams.hpp"

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

/// fsync, and whether what was written may be lost. File systems that cannot do it for a file or a folder (CIFS, sshfs,
/// vboxsf and others, by many names) have done what they can.
bool synced(int fd) {
    for (int tries = 0; tries < 100; ++tries) {
        if (::fsync(fd) == 0) return true;
        if (errno != EINTR) break;
    }
    switch (errno) {
        case EINVAL:
        case ENOSYS:
        case ENOTSUP:
#if EOPNOTSUPP != ENOTSUP
        case EOPNOTSUPP:
#endif
        case ENOTTY:
        case EROFS:
        case EBADF:
        case EISDIR:
        case EACCES:
        case EPERM:
            return true;
        default:
            return false;
    }
}

void refuse_other_kinds(const std::string& path, mode_t mode) {
    if (!S_ISREG(mode)) throw Error("{}: expected a plain file, found a {}", path, kind_name(mode));
}

}  // namespace

const char* kind_name(std::uint32_t mode) {
    if (S_ISREG(mode)) return "plain file";
    if (S_ISDIR(mode)) return "folder";
    if (S_ISFIFO(mode)) return "pipe";
    if (S_ISSOCK(mode)) return "socket";
    if (S_ISLNK(mode)) return "symbolic link";
    return S_ISBLK(mode) ? "block device" : "device";
}

void require_readable(const std::string& path) {
    const Descriptor file(path, O_RDONLY | O_NONBLOCK);
    struct stat info = {};
    if (file.fd < 0 || ::fstat(file.fd, &info) != 0) throw Error("{}: cannot be read: {}", path, reason());
    refuse_other_kinds(path, info.st_mode);
}

std::vector<unsigned char> read_file(const std::string& path, std::uint64_t most) {
    const Descriptor file(path, O_RDONLY | O_NONBLOCK);  // to open a pipe waits for its writer otherwise
    struct stat info = {};
    if (file.fd < 0 || ::fstat(file.fd, &info) != 0) throw Error("{}: cannot be read: {}", path, reason());
    refuse_other_kinds(path, info.st_mode);
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

namespace {

std::size_t longest_name(const std::string& folder) {
    const long most = ::pathconf(folder.c_str(), _PC_NAME_MAX);
    return most > 0 ? static_cast<std::size_t>(most) : NAME_MAX;
}

std::string last_part(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace

std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> number{0};
    char host[65] = "host";
    ::gethostname(host, sizeof host - 1);
    const std::string name = last_part(path), folder = path.substr(0, path.size() - name.size());
    std::string temporary;
    struct stat info = {};
    do {  // a process before us may have had our number, and been killed
        const std::string end = fmt::format(".tmp-{}-{}-{}", host, ::getpid(), number++);
        const bool fits = name.size() + end.size() <= longest_name(folder_of(path));
        temporary = folder + (fits ? name : "medulla") + end;
    } while (::lstat(temporary.c_str(), &info) == 0);
    return temporary;
}

void check_name(const std::string& path) {
    const std::size_t most = longest_name(folder_of(path)), found = last_part(path).size();
    if (found > most) throw Error("{}: expected a name of at most {} bytes, found {}", path, most, found);
}

PendingFile::PendingFile(std::string path, std::string temporary)
    : path_(std::move(path)), temporary_(temporary.empty() ? temporary_name(path_) : std::move(temporary)) {
    struct stat info = {};
    if (::lstat(path_.c_str(), &info) == 0) refuse_other_kinds(path_, info.st_mode);
    fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd_ < 0) throw Error("{}: cannot be written: {}", path_, reason());
}

PendingFile::~PendingFile() {
    if (fd_ >= 0) ::close(fd_);
    if (!committed_) ::unlink(temporary_.c_str());
}

void PendingFile::write(const void* data, std::size_t size) {
    if (!write_all(fd_, data, size)) throw Error("{}: cannot be written: {}", path_, reason());
}

void PendingFile::commit() {
    if (!synced(fd_)) throw Error("{}: could not be brought to disk: {}", path_, reason());
    if (::close(std::exchange(fd_, -1)) != 0 && errno != EINTR)
        throw Error("{}: could not be closed: {}", path_, reason());
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

void sync_folder(const std::string& path) {
    const Descriptor folder(path, O_RDONLY | O_DIRECTORY);
    if (folder.fd < 0) return;  // a folder that may be written but not listed
    if (!synced(folder.fd)) throw Error("{}: could not be brought to disk: {}", path, reason());
}

std::string folder_of(const std::string& path) {
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    return folder.empty() ? "." : folder.string();
}

}  // namespace medulla::tables
