// The folder `<output>.shards/` with one file per solved slice, each either complete and on disk or absent
// (docs/formats.md). An interrupted run leaves it, workers on many machines write to it, and the tables file is made
// from it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tables/store/slices.hpp"

namespace medulla::tables {

/// Header of a slice file; all numbers little-endian. It is followed by energy, energy_error, standard_error,
/// mean_length (float64[cells]), lobe (float32[cells][bins]), SHA-256 of everything before.
struct SliceFileHeader {
    char magic[8];                    ///< "FURSHARD"
    std::uint32_t version;            ///< slice_file_version
    std::uint32_t table;              ///< a TableId
    unsigned char configuration[32];  ///< configuration_hash of the job
    std::uint32_t sigma, g;           ///< indices on the axes
    std::uint64_t cells, bins;
};
static_assert(sizeof(SliceFileHeader) == 72);
inline constexpr std::uint32_t slice_file_version = 1;

class SliceFolder {
  public:
    /// The folder of a plan; accesses no file.
    SliceFolder(std::string path, const Tables& plan);
    ~SliceFolder();

    /// `<output>.shards`
    static std::string beside(const std::string& output) { return output + ".shards"; }

    const std::string& path() const { return path_; }
    std::string file_of(const SliceId& id) const;

    /// Creates the folder and its configuration.json if missing, and locks it: exclusively (a complete run) or shared
    /// with other workers (--shard). Throws Error if it is locked otherwise or has another configuration. An exclusive
    /// lock removes temporary files of killed runs.
    void open(bool alone);

    /// Names of slice files, of any configuration; empty without a folder.
    std::vector<std::string> files() const;

    /// For each of `ids` whether its file is complete. A damaged file is reported on standard error and counts as
    /// missing. Throws Error for a file of another configuration.
    std::vector<bool> kept(const std::vector<SliceId>& ids) const;

    /// Writes one slice to disk atomically. From any thread.
    void write(const SliceId& id, const Slice& slice) const;

    /// Reads and checks one slice: size, magic, version, configuration, indices, SHA-256. For a damaged file `why` is
    /// the reason. Throws Error for a file of another configuration.
    std::optional<Slice> read(const SliceId& id, std::string& why) const;

    /// A name in the folder for the tables file while it is written; removed with the folder.
    std::string scratch() const;

    /// Removes everything of ours and the folder. What is not ours keeps it there; what cannot be removed is told on
    /// standard error, since the job is done.
    void remove();
    /// Removes the folder if it has no slice and is locked exclusively.
    void remove_if_empty();

  private:
    /// Throws Error that says in which options the job of `file`, of configuration `found`, is another one.
    void refuse_other(const std::string& file, const Digest& found) const;

    std::string path_;
    const Tables& plan_;
    std::string configuration_text_;
    Digest configuration_;
    int lock_ = -1;
    bool alone_ = false;
};

/// The job of a folder, from its configuration.json: axes, methods, seeds, no arrays. Throws Error.
Tables read_configuration(const std::string& folder);

}  // namespace medulla::tables
