// One interface to lobes of a tables file and of a pack.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "medulla/pack.hpp"
#include "tables/table/table.hpp"

namespace medulla::tables {

/// A point of a table's parameter space, each value in its axis's unit (docs/formats.md).
struct Parameters {
    double sigma = 0, g = 0, h = 0, theta_i = 0, absorption = 0;
    double operator[](const std::string& axis) const;
    void set(const std::string& axis, double value);

  private:
    double* field(const std::string& axis);
};

/// The three kinds of lobe, in the order every program lists them.
inline constexpr std::array<TableKind, 3> lobe_kinds = {TableKind::azimuthal, TableKind::longitudinal_back,
                                                        TableKind::longitudinal_forward};
const char* name_of(TableKind kind);
/// The simulated table that a kind of pack table is made from, and which side of the slab (back 0, forward 1).
TableId table_of(TableKind kind);
std::size_t side_of(TableKind kind);
/// "phi" or "theta_r".
const char* exit_name(TableKind kind);

class Source {
  public:
    virtual ~Source() = default;

    virtual bool has(TableKind kind) const = 0;
    /// Parameter axes of a lobe kind (node values), without the exit axis.
    virtual std::vector<Axis> parameter_axes(TableKind kind) const = 0;
    /// Bins of the exit axis of the simulated table.
    virtual std::size_t bins(TableKind kind) const = 0;
    /// Averages over `bins` equal bins of the normalised lobe [1/radian].
    virtual std::vector<double> lobe(TableKind kind, const Parameters& at, std::size_t bins) const = 0;
    /// Relative L2 standard error of a lobe, interpolated between nodes. For a pack: of all lobes of its table, from
    /// its provenance. 0 if unknown.
    virtual double noise(TableKind kind, const Parameters& at) const = 0;
    /// Share of the slab's scattered energy that leaves backward.
    virtual double back_fraction(const Parameters& at) const = 0;
    /// Share of the disc's scattered energy that is not absorbed; 1 without an axis of absorption.
    virtual double survival(const Parameters& at) const = 0;
    bool absorbs() const;  ///< azimuthal lobes have an axis of absorption

    /// Text with the first axis whose range does not contain `at`, the range and the value. Empty if there is none, or
    /// no such table.
    std::string beyond(TableKind kind, const Parameters& at) const;
    /// Throws Error that says beyond(..); checks presence first.
    void check(TableKind kind, const Parameters& at, const std::string& path) const;
};

/// Energy of a lobe: the closed form, times the share of the side (slab) or the share that is not absorbed (disc).
double energy_of(const Source& source, TableKind kind, const Parameters& at);

/// Opens a tables file or a pack; the name `default` is the pack built into this program. Throws Error.
std::unique_ptr<Source> open_source(const std::string& path);
std::unique_ptr<Source> table_source(Tables tables);
std::unique_ptr<Source> pack_source(std::vector<unsigned char> bytes, const std::string& path);

/// Reads and validates a pack's bytes (`default`: the one built in). Throws Error that names the path and, with
/// `or_tables`, says that a tables file is accepted as well.
std::vector<unsigned char> read_pack(const std::string& path, bool or_tables = false);

/// Error of one source against another, over every node of the reference.
struct LobeError {
    TableKind kind;
    double relative = 0;             ///< L2 over all lobes and bins, relative to the reference's
    double worst = 0;                ///< largest relative L2 of one lobe
    std::string worst_at;            ///< its parameters
    double energy = 0;               ///< largest |integral - 1| of a lobe
    double least = 0;                ///< smallest value (bin average)
    std::optional<double> survival;  ///< largest difference of survivals, if both have an axis of absorption
    std::size_t lobes = 0;
    /// Relative L2 standard error of the reference, which limits what can be said about the candidate: `claim` and
    /// `worst_claim` are the errors above with it added in quadrature.
    double noise = 0, claim = 0, worst_claim = 0;
    double back_share = 0;  ///< slab: largest difference of the shares of energy that leave backward
};
std::vector<LobeError> compare(const Source& reference, const Source& candidate);

}  // namespace medulla::tables
