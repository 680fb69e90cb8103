// A stand-in: see kernel/types.h.
#pragma once

#include "kernel/types.h"

namespace ccl {
inline void* closure_alloc_extra(ShaderData* sd, const int size) {
    return sd->full || std::size_t(size) > sizeof sd->extra ? nullptr : sd->extra;
}
}  // namespace ccl
