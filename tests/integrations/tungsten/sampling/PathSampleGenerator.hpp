// A stand-in: see bsdfs/Bsdf.hpp.
#pragma once
