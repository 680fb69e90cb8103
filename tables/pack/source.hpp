// One way to ask either file for a lobe: a tables file or a pack behind the same three questions.
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
/// "phi" or "theta_r".
const char* exit_name(TableKind kind);

class Source {
  public:
    virtual ~Source() = default;

    virtual bool has(TableKind kind) const = 0;
    /// Parameter axes of a lobe kind (node values), without the exit axis.
    virtual std::vector<Axis> parameter_axes(TableKind kind) const = 0;
    /// Bins of the exit axis it was made on.
    virtual std::size_t bins(TableKind kind) const = 0;
    /// Averages over `bins` equal bins of the normalised lobe [1/radian].
    virtual std::vector<double> lobe(TableKind kind, const Parameters& at, std::size_t bins) const = 0;
    /// Relative L2 standard error of a lobe (between nodes: interpolated); of a pack, that of all lobes of the table it
    /// was made from, as its provenance has it. 0 where nothing is known.
    virtual double noise(TableKind kind, const Parameters& at) const = 0;
    /// Share of the slab's scattered energy that leaves backward.
    virtual double back_fraction(const Parameters& at) const = 0;
    /// Share of the disc's scattered energy that absorption leaves; 1 where there is no such axis.
    virtual double survival(const Parameters& at) const = 0;
    bool absorbs() const;  ///< whether azimuthal lobes have an axis of absorption

    /// The first axis beyond whose ends `at` lies, its range and the value, as text; empty if it lies within, or there
    /// is no such table.
    std::string beyond(TableKind kind, const Parameters& at) const;
    /// Throws Error that says beyond(..); checks presence first.
    void check(TableKind kind, const Parameters& at, const std::string& path) const;
};

/// The energy that belongs to a lobe: closed form, times the share of its side for the slab, times what absorption
/// leaves for the disc.
double energy_of(const Source& source, TableKind kind, const Parameters& at);

/// Opens a tables file or a pack; the name `default` is the pack built into this program. Throws Error.
std::unique_ptr<Source> open_source(const std::string& path);
std::unique_ptr<Source> table_source(Tables tables);
std::unique_ptr<Source> pack_source(std::vector<unsigned char> bytes, const std::string& path);

/// Reads and validates a pack's bytes (`default`: the one built in). Throws Error that names the path; `or_tables`:
/// that a tables file would do as well.
std::vector<unsigned char> read_pack(const std::string& path, bool or_tables = false);

/// Error of one source against another, over every node of the reference.
struct LobeError {
    TableKind kind;
    double relative = 0;             ///< L2 over all lobes and bins, relative to the reference's
    double worst = 0;                ///< greatest relative L2 of one lobe
    std::string worst_at;            ///< its parameters
    double energy = 0;               ///< greatest |integral - 1| of a lobe
    double least = 0;                ///< least value (bin average)
    std::optional<double> survival;  ///< greatest difference of survivals, where both have an axis of absorption
    std::size_t lobes = 0;
    /// Relative L2 standard error of the reference. What the candidate is off from the truth by cannot be known better:
    /// `claim` and `worst_claim` are the errors above with it added in squares.
    double noise = 0, claim = 0, worst_claim = 0;
    double back_share = 0;  ///< slab: greatest difference of the shares of energy that leave backward
};
std::vector<LobeError> compare(const Source& reference, const Source& candidate);

}  // namespace medulla::tables
