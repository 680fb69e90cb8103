// A stand-in: see render/bsdf.h.
#pragma once
