// HDF5 for the files of this program: handles that close themselves, files that are built in memory, arrays with
// checksums, and reading that checks before it trusts. Rests on zstd_filter.hpp.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tables/error.hpp"
#include "tables/store/output.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {

/// An HDF5 id that closes itself.
class Handle {
  public:
    Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close) {
        if (id_ < 0) throw Error("{}", what);
    }
    ~Handle() { close_(id_); }
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    operator hid_t() const { return id_; }

  private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

void check(herr_t status, const std::string& what);

/// A property list without time stamps, so that equal runs give equal files.
Handle untracked(hid_t kind, const std::string& where);

void write_attribute(hid_t object, const char* name, const std::string& text, const std::string& where);
void write_attribute(hid_t object, const char* name, std::uint64_t value, const std::string& where);
void write_attribute(hid_t object, const char* name, double value, const std::string& where);

struct NumberType {
    hid_t file, memory;
};
/// Writes one array in chunks, each with a checksum for any compression, so that every flipped bit is detected.
void write_array(hid_t group, const std::string& name, const std::vector<hsize_t>& shape, const NumberType& type,
                 const void* data, Compression compression, const std::vector<hsize_t>& chunk,
                 const std::string& where);

/// Writes a file that `fill` builds in memory, since HDF5 closes a file on a full disk without an error.
void write_hdf5(const Output& output, const std::function<void(hid_t file)>& fill, const std::string& temporary = {});

/// Opens a file for reading, without a lock, which some file systems do not support: files appear complete under their
/// names. Throws Error. @param what "a tables file"
Handle open_hdf5(const std::string& path, const char* what);

/// One attribute value of any HDF5 string type: fixed or variable length, with any padding.
std::string read_text(hid_t object, const char* name, const std::string& where);
std::uint64_t read_whole(hid_t object, const char* name, const std::string& where);
/// A positive number, 0 if the attribute is missing.
double read_optional(hid_t object, const char* name, const std::string& where);

std::string shape_text(const std::vector<hsize_t>& shape);

/// T is float or double. @param expected shape; empty: any number of values of one dimension, 1 to 4096
template <class T>
std::vector<T> read_array(hid_t group, const std::string& name, hid_t memory, const std::vector<hsize_t>& expected,
                          const std::string& where, bool may_be_infinite = false);

}  // namespace medulla::tables
