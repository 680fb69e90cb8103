#include <cstdlib>
#include "sim2d/tracer_kernel.hpp"
namespace medulla::sim2d {
TracerPlan plan_of(const TracerCell& cell) {
    TracerPlan p;
    auto e = [](const char* n, double d) {
        const char* v = getenv(n);
        return v ? atof(v) : d;
    };
    p.forced = (unsigned)e("FORCED", 4);
    p.keep = (float)e("KEEP", .3);
    p.pay = (float)e("PAY", .25);
    p.comb = (unsigned)e("COMB", 1);
    while (cell.bins % p.comb) --p.comb;
    p.window = (unsigned)e("WINDOW", 0);
    return p;
}
}  // namespace medulla::sim2d
