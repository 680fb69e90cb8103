// Dense tables with the memory that they lie in, and a fibre that owns its tables.
#pragma once

#include <cstddef>
#include <memory>
#include <new>

#include "medulla/medulla.hpp"

namespace medulla::test {

inline const PackView& shipped() {
    static const PackView view = default_pack();
    return view;
}

/// Dense tables over some ranges. Where make_tables refuses, `get` is null and `status` says why.
class OwnedTables {
  public:
    OwnedTables(const PackView& pack, const TableRanges& ranges) : bytes_(tables_bytes(pack, ranges)) {
        // Exactly as many bytes as are asked for, so that the address sanitizer sees any beyond them.
        if (bytes_ > 0) memory_.reset(::operator new(bytes_, std::align_val_t(64)));
        result_ = make_tables(pack, ranges, memory_.get(), bytes_);
    }
    const DenseTables* get() const { return result_.tables; }
    const DenseTables& operator*() const { return *result_.tables; }
    const DenseTables* operator->() const { return result_.tables; }
    TablesStatus status() const { return result_.status; }
    std::size_t bytes() const { return bytes_; }
    /// To damage them.
    unsigned char* memory() const { return static_cast<unsigned char*>(memory_.get()); }

  private:
    struct Free {
        void operator()(void* p) const { ::operator delete(p, std::align_val_t(64)); }
    };
    std::size_t bytes_;
    std::unique_ptr<void, Free> memory_;
    TablesResult result_ = {};
};

/// A fibre with tables over `ranges`, its own by default.
template <int Channels = 3>
struct FibreOf : Fibre<Channels> {
    FibreOf(const FurParameters<Channels>& p, const PackView& pack) : FibreOf(p, pack, ranges_of(p)) {}
    FibreOf(const FurParameters<Channels>& p, const PackView& pack, const TableRanges& ranges) : owned(pack, ranges) {
        static_cast<Fibre<Channels>&>(*this) = make_fibre(p, owned.get());
    }
    OwnedTables owned;
};

}  // namespace medulla::test
