// medulla: the fur fibre's scattering core in any renderer. The only header to include; C++17, the standard library
// alone; no allocation, no exceptions, no globals with constructors; every function is pure and thread-safe.
#pragma once

#include "medulla/axis.hpp"
#include "medulla/config.hpp"
#include "medulla/default_pack.hpp"
#include "medulla/lookup.hpp"
#include "medulla/pack.hpp"
#include "medulla/phase.hpp"
