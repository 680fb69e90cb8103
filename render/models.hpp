// The models that fur-render can shade fibres with, from a fur material's parameters (medulla/models/from_fur.hpp).
#pragma once

#include "medulla/models/from_fur.hpp"
#include "render/path.hpp"

namespace medulla::render {

/// Calls use(hit) of one of the other models. @param whole_width the mean over the width, where a model has a choice
template <class Use>
void with_model(FibreModel model, const Fibre<3>& fibre, Vector known, float h, bool whole_width, Use&& use) {
    using namespace models;
    const FurParameters<3>& p = fibre.parameters;
    switch (model) {
        case FibreModel::kajiya_kay:
            return use(far_field(kajiya_kay_of(p, false), known));
        case FibreModel::kajiya_kay_normalised:
            return use(far_field(kajiya_kay_of(p, true), known));
        case FibreModel::kim:
            return use(far_field(kim_of(p), known));
        case FibreModel::marschner:
            return use(far_field(marschner_of(p), known));
        case FibreModel::zinke:
            return whole_width ? use(far_field(zinke_of(p), known)) : use(near_field(zinke_of(p), known, h));
        case FibreModel::deon:
            return use(far_field(deon_of(p), known));
        case FibreModel::chiang:
            return use(near_field(chiang_of(p), known, h));
        case FibreModel::yan2015:
            return use(near_field(yan2015_of(p), fibre.tables, known, h));
        case FibreModel::fur:
        case FibreModel::eq12:
            break;
    }
}

}  // namespace medulla::render
