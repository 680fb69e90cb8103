#include "tables/store/output.hpp"

#include <fcntl.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>

#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

constexpr int most_links = 40;  // as many as Linux follows
constexpr int reader_ms = 1000;

std::string reason() { return std::strerror(errno); }

[[noreturn]] void cannot(const std::string& path) { throw Error("{}: cannot be written: {}", path, reason()); }

/// Where a path leads to, and what is there.
struct Place {
    std::string path;
    mode_t mode = 0;         ///< 0: nothing yet
    bool open_file = false;  ///< one of /proc's links to files that a process has open: its text need not be a path
};

bool on_proc(const std::string& folder) {
    struct statfs info = {};
    return ::statfs(folder.c_str(), &info) == 0 && info.f_type == PROC_SUPER_MAGIC;
}

Place place_of(const std::string& path) {
    Place place{path};
    for (int links = 0; links < most_links; ++links) {
        struct stat info = {};
        if (::lstat(place.path.c_str(), &info) != 0) {
            if (errno != ENOENT) cannot(path);
            place.mode = 0;
            return place;
        }
        place.mode = info.st_mode;
        if (!S_ISLNK(info.st_mode)) return place;
        const std::string folder = folder_of(place.path);
        if (on_proc(folder)) {
            if (::stat(place.path.c_str(), &info) != 0) cannot(path);
            place.mode = info.st_mode, place.open_file = true;
            return place;
        }
        char text[PATH_MAX];
        const ssize_t size = ::readlink(place.path.c_str(), text, sizeof text);
        if (size < 0) cannot(path);
        const std::string next(text, static_cast<std::size_t>(size));
        place.path = next.empty() || next[0] == '/' ? next : folder + "/" + next;
    }
    errno = ELOOP;
    cannot(path);
}

/// A plain file is renamed into its folder, so that is what must be writable; one that its owner protects stays.
void check_plain(const Place& place, const std::string& path) {
    const std::string folder = folder_of(place.path);
    struct stat info = {};
    if (::stat(folder.c_str(), &info) != 0) throw Error("{}: cannot be written: {}: {}", path, folder, reason());
    if (!S_ISDIR(info.st_mode))
        throw Error("{}: expected {} to be a folder, found a {}", path, folder, kind_name(info.st_mode));
    check_name(place.path);
    if (::faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) != 0) cannot(path);
    if (place.mode != 0 && ::faccessat(AT_FDCWD, place.path.c_str(), W_OK, AT_EACCESS) != 0) cannot(path);
}

/// Another descriptor of a file that this process has open, which shares its position; none where it is no such file.
std::optional<int> own_descriptor(const Place& place) {
    std::error_code none;
    if (!place.open_file || !std::filesystem::equivalent(folder_of(place.path), "/proc/self/fd", none))
        return std::nullopt;
    const std::string name = place.path.substr(place.path.rfind('/') + 1);
    int number = -1;
    std::from_chars(name.data(), name.data() + name.size(), number);
    const int flags = ::fcntl(number, F_GETFL);
    if (flags >= 0 && (flags & O_ACCMODE) != O_RDONLY) return ::fcntl(number, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    errno = EBADF;
    return -1;
}

/// Waits a moment for the reader of a pipe, which whoever starts both may start second.
int open_pipe(const Place& place) {
    for (int waited = 0;; ++waited) {
        const int fd = ::open(place.path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
        if (fd >= 0) ::fcntl(fd, F_SETFL, O_WRONLY);
        if (fd >= 0 || errno != ENXIO || waited == reader_ms) return fd;
        ::usleep(1000);
    }
}

bool same_file(int a, int b) {
    struct stat one = {}, other = {};
    return ::fstat(a, &one) == 0 && ::fstat(b, &other) == 0 && one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

bool is_null(int fd) {
    struct stat info = {};
    return ::fstat(fd, &info) == 0 && S_ISCHR(info.st_mode) && info.st_rdev == makedev(1, 3);
}

}  // namespace

Output::Output(std::string path, const std::vector<std::string>& inputs) : path_(std::move(path)) {
    for (const std::string& input : inputs) {
        std::error_code none;  // a file that is not there yet is no input
        if (std::filesystem::equivalent(path_, input, none))
            throw Error("{}: expected another output than the input, found {}", path_, input);
    }
    const Place place = place_of(path_);
    if (S_ISDIR(place.mode)) throw Error("{}: expected the name of a file, found a folder", path_);
    if (path_.empty() || path_.back() == '/')
        throw Error("{}: expected the name of a file, found one that ends with /", path_);
    target_ = place.path;
    if (!place.open_file && (place.mode == 0 || S_ISREG(place.mode))) {
        check_plain(place, path_);
        return;
    }
    kind_ = kind_name(place.mode);
    if (S_ISBLK(place.mode) || (S_ISSOCK(place.mode) && !place.open_file))
        throw Error("{}: expected a file, a pipe or a device such as /dev/null, found a {}", path_, kind_);
    if (const std::optional<int> mine = own_descriptor(place)) {
        fd_ = *mine;
    } else if (S_ISFIFO(place.mode)) {
        fd_ = open_pipe(place);
        if (fd_ < 0 && errno == ENXIO) throw Error("{}: expected a pipe that is read, found no reader", path_);
    } else {
        fd_ = ::open(place.path.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC);
    }
    if (fd_ < 0) cannot(path_);
    if (is_null(fd_)) return;
    if (same_file(fd_, STDERR_FILENO)) {
        ::close(fd_);
        throw Error("{}: expected another output than standard error, where messages go", path_);
    }
    if (same_file(fd_, STDOUT_FILENO)) ::dup2(STDERR_FILENO, STDOUT_FILENO);
}

Output::~Output() {
    if (fd_ >= 0) ::close(fd_);
}

void Output::require_plain() const {
    if (fd_ >= 0) throw Error("{}: expected a plain file, found a {}", path_, kind_);
}

void Output::write(const void* data, std::size_t size, const std::string& temporary) const {
    if (fd_ >= 0) {
        if (!write_all(fd_, data, size)) cannot(path_);
        return;
    }
    struct stat here = {}, there = {};
    const bool usable = !temporary.empty() && ::stat(folder_of(temporary).c_str(), &here) == 0 &&
                        ::stat(folder_of(target_).c_str(), &there) == 0 && here.st_dev == there.st_dev;
    PendingFile pending(target_, usable ? temporary : std::string());
    pending.write(data, size);
    pending.commit();
}

}  // namespace medulla::tables
