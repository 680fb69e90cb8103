// A stand-in: see kernel/types.h.
#pragma once
