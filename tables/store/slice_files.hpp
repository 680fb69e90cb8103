// The folder `<output>.shards/`: one file per solved slice, each whole and on disk or not there. docs/formats.md.
// What a killed run leaves behind, what workers on many machines write into, and what the tables file is made from.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tables/store/slices.hpp"

namespace medulla::tables {

/// First bytes of a shard; all numbers little-endian. After it: energy, energy_error, standard_error, mean_length
/// (float64[cells]), lobe (float32[cells][bins]), SHA-256 of all before.
struct SliceFileHeader {
    char magic[8];                    ///< "FURSHARD"
    std::uint32_t version;            ///< slice_file_version
    std::uint32_t table;              ///< a TableId
    unsigned char configuration[32];  ///< configuration_hash of the job
    std::uint32_t sigma, g;           ///< place on the axes
    std::uint64_t cells, bins;
};
static_assert(sizeof(SliceFileHeader) == 72);
inline constexpr std::uint32_t slice_file_version = 1;

class SliceFolder {
  public:
    /// Names the folder of a plan; touches no file.
    SliceFolder(std::string path, const Tables& plan);
    ~SliceFolder();

    /// `<output>.shards`
    static std::string beside(const std::string& output) { return output + ".shards"; }

    const std::string& path() const { return path_; }
    std::string file_of(const SliceId& id) const;

    /// Makes the folder and its configuration.json, where they are missing, and holds it: alone (a whole run), or
    /// beside other workers (--shard). Throws Error where another run holds it otherwise, or where the folder is of
    /// another configuration. Alone, temporary files of killed runs are removed.
    void open(bool alone);

    /// Names of files that look like shards, of whatever configuration; none if there is no folder.
    std::vector<std::string> files() const;

    /// Slices among `ids` that are kept whole. A damaged one is told on standard error and counts as missing.
    /// Throws Error for one of another configuration.
    std::vector<bool> kept(const std::vector<SliceId>& ids) const;

    /// Brings one slice to disk under its name, in one step. From any thread.
    void write(const SliceId& id, const Slice& slice) const;

    /// Reads and checks one slice: size, magic, version, configuration, place, SHA-256. `why` says what is wrong with
    /// a damaged one. Throws Error for one of another configuration.
    std::optional<Slice> read(const SliceId& id, std::string& why) const;

    /// A name inside the folder for the tables file in work: the folder's removal takes it along.
    std::string scratch() const;

    /// Removes everything of ours and the folder. What is not ours keeps it there; what cannot be removed is told on
    /// standard error, since the job is done.
    void remove();
    /// Removes the folder if it keeps no slice and nobody else works on it.
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

/// The job of a shard folder, from its configuration.json: axes, methods, seeds, no arrays. Throws Error.
Tables read_configuration(const std::string& folder);

}  // namespace medulla::tables
