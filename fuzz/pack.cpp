// libFuzzer: bytes -> open_pack -> everything that a renderer asks of a pack, lookups all finite, and of fibres that
// read it (whose products of two lobes of an absurd pack may not be). The checksum is mended in half of the inputs (by
// their first byte), so that the checks behind it are reached.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "medulla/medulla.hpp"

using namespace medulla;

namespace {

void ask(const PackView& pack) {
    for (const float sigma : {0.0f, 0.7f, 30.0f, -1.0f})
        for (const float other : {0.0f, 0.6f, -2.0f}) {
            const auto see = [&](float value) {  // sigma < 0 and h < -1 have no answer: roots of them are taken
                if (!std::isfinite(value) && sigma >= 0 && other >= 0) std::abort();
            };
            for (const TableView& table : pack.tables) {
                if (!table || !table.has_exit()) continue;
                const auto kind = static_cast<TableKind>(table.layout.kind);
                if (kind == TableKind::azimuthal) see(azimuthal(pack, sigma, other, other, 1.0f));
                if (kind == TableKind::longitudinal_back)
                    see(longitudinal(pack, Side::back, sigma, other, other, 0.3f));
                if (kind == TableKind::longitudinal_forward)
                    see(longitudinal(pack, Side::forward, sigma, other, other, 0.3f));
                LobeQuery query = {};
                query.sigma = sigma, query.g = other, query.h = other, query.theta_i = other;
                ExitDistribution distribution;
                distribute(table, contract(table, query), distribution);
                see(distribution.pdf(0.2f));
                see(distribution.sample(0.7f));
            }
        }
}

void ask_fibre(const FurParameters<1>& material, const PackView& pack, UnfoldedTables& tables) {
    FurFibre<1> fibre;
    prepare(material, pack, fibre);
    for (int pass = 0; pass < 2; ++pass) {
        for (const float theta_i : {0.0f, -1.2f, 1.5707f}) {
            NearField<1> near;
            near_field(fibre, theta_i, 0.6f, near);
            NearSampler<1> sampler;
            sampler.prepare(near);
            const FurSample<1> sample = sampler.sample({0.9f, 0.7f, 0.3f, 0.1f});
            near.eval(sample.theta_r, sample.phi);
            float theta_r[16], phi[16];
            Colour<1> S[16];
            for (int i = 0; i < 16; ++i) theta_r[i] = 0.2f * float(i) - 1.5f, phi[i] = 0.4f * float(i) - 3;
            eval(near, 16, theta_r, phi, S);
            FarField<1> far;
            far_field(fibre, theta_i, {}, far, FarQuality::draft);
            far.eval(0.2f, 1.0f);
        }
        if (!unfold(fibre, tables)) return;
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    if (size == 0) return 0;
    std::vector<unsigned char> bytes(data + 1, data + size);
    if (data[0] % 2 == 1 && bytes.size() >= sizeof(PackHeader)) {
        const std::uint64_t count = bytes.size();
        std::memcpy(bytes.data() + offsetof(PackHeader, byte_count), &count, sizeof count);
        const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
        std::memcpy(bytes.data() + offsetof(PackHeader, checksum), &sum, sizeof sum);
    }
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    if (opened.status != PackStatus::ok) return 0;
    ask(opened.pack);
    static UnfoldedTables tables;
    FurParameters<1> material = parameters_of<1>(*find_preset("bobcat"));
    ask_fibre(material, opened.pack, tables);
    material.sigma_ma = 0.5f, material.eta = 1.3f;
    ask_fibre(material, opened.pack, tables);
    return 0;
}
