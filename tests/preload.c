// LD_PRELOAD: file systems that cannot lock or bring to disk, as errno values in FAKE_FSYNC (files), FAKE_FSYNC_DIR and
// FAKE_FLOCK. What they stand for is in tests/outputs.py.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static int faked(const char* name) {
    const char* value = getenv(name);
    if (!value) return 0;
    errno = atoi(value);
    return 1;
}

int flock(int fd, int operation) {
    if (faked("FAKE_FLOCK")) return -1;
    int (*real)(int, int) = (int (*)(int, int))dlsym(RTLD_NEXT, "flock");
    return real(fd, operation);
}

int fsync(int fd) {
    struct stat info;
    if (fstat(fd, &info) == 0 && faked(S_ISDIR(info.st_mode) ? "FAKE_FSYNC_DIR" : "FAKE_FSYNC")) return -1;
    int (*real)(int) = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
    return real(fd);
}
