// The light of one fibre on disk (HDF5): docs/formats.md. Everything read is checked before it is used.
#pragma once

#include <optional>
#include <string>

#include "tables/bake/fibre_light.hpp"
#include "tables/store/output.hpp"
#include "tables/store/sha256.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {

/// Writes a file with this light atomically. Equal light gives the same bytes.
void write_fibre(const Output& output, const FibreLight& light, Compression compression);

/// Throws Error.
FibreLight read_fibre(const std::string& path);

/// Whether it is an HDF5 file with the light of a fibre, of any version.
bool is_fibre_file(const std::string& path);

/// JSON of everything that decides the bytes of the light: equal text means equal light.
std::string configuration_text(const FibreRequest& request);

/// In what two jobs differ, from their configuration_text: "paths: expected 200000, found 1000".
std::string configuration_difference(const std::string& expected, const std::string& found);

/// Cells that are simulated so far, in a file of their own beside the output while a job runs.
class PartialFibre {
  public:
    PartialFibre(const std::string& output, const FibreLight& plan);

    const std::string& path() const { return path_; }
    bool exists() const;
    /// Writes the cells that are set, of all, atomically.
    void write(const std::vector<std::optional<LightCell>>& cells) const;
    /// Reads what write() wrote. A damaged file is reported on standard error and counts as empty. Throws Error for a
    /// file of another job.
    void read(std::vector<std::optional<LightCell>>& cells) const;
    void remove() const;

  private:
    std::string path_, configuration_;
    std::size_t nodes_, node_size_, check_size_;  ///< numbers of a cell: of the nodes, and of the checks after them
};

}  // namespace medulla::tables
