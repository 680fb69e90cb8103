// medulla: the fur fibre's scattering core in any renderer. The only header to include; C++17, the standard library
// alone; no allocation, no exceptions, no globals with constructors; every function is pure and thread-safe.
#pragma once

#include "medulla/axis.hpp"
#include "medulla/config.hpp"
#include "medulla/cross_section.hpp"
#include "medulla/default_pack.hpp"
#include "medulla/exit_distribution.hpp"
#include "medulla/far_field.hpp"
#include "medulla/frame.hpp"
#include "medulla/fur_fibre.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/gauss_legendre.hpp"
#include "medulla/gaussian.hpp"
#include "medulla/held_integral.hpp"
#include "medulla/lanes.hpp"
#include "medulla/lookup.hpp"
#include "medulla/pack.hpp"
#include "medulla/phase.hpp"
#include "medulla/real_math.hpp"
#include "medulla/sampling.hpp"
