// The cuticle as an interface of microfacets: tilted scales with Gaussian slopes along and around the fibre, a layered
// Fresnel reflectance at each facet, and as many reflections among facets as it takes to leave.
//
// A direction d above the facets meets one at the rate Z(d) = E[(-d . n)+] over normals n = N + a x + b t, and leaves
// at the rate (d . N)+, N the tilted normal. Z(d) + (d . N)+ is the same for d and -d, so that the surface keeps energy
// and, without a tilt, is reciprocal: Smith's uncorrelated surface (Heitz et al. 2016), without heights.
#pragma once

#include "sim2d/random.hpp"
#include "sim3d/fibre.hpp"

namespace medulla::sim3d {

struct Vec3 {
    double x, y, z;
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Unpolarised reflectance of one interface to a medium of relative index n > 0, met at the cosine c; 1 beyond the
/// critical angle.
double interface_reflectance(double n, double c);

/// 2 R / (1 + R), the mean over polarisations, stacked `layers` times (Eq. 13); `excess` = n^2 - 1 > 0, c outside.
double layered_reflectance(double excess, double c, double layers);

/// Mirror image and refracted direction; `c` = -(d . n) > 0, `ratio` = index on the other side over that on this one.
inline Vec3 reflected(Vec3 d, Vec3 n, double c) { return d + n * (2 * c); }
Vec3 refracted(Vec3 d, Vec3 n, double c, double ratio);

enum class Side : int { outside = 1, inside = -1 };

/// A standard normal p weighted with (mu + p)+: density (mu + p)+ exp(-p^2 / 2) / (sqrt(2 pi) (mu Phi(mu) + phi(mu))).
double sample_visible(double mu, sim2d::RandomStream& random);
/// The same, given p > |mu|.
double sample_visible_tail(double mu, sim2d::RandomStream& random);
/// (mu Phi(mu) + phi(mu)): E[(mu + p)+].
double visible_mass(double mu);

/// What a direction at the surface does next.
enum class Next {
    leave_or_meet,  ///< leaves, or meets a facet
    meet,           ///< meets a facet
    meet_tail,      ///< meets a facet of the tail, see sample_visible_tail
};

class CuticleSurface {
  public:
    explicit CuticleSurface(const Fibre& fibre);

    /// Follows a direction that is at the surface until it leaves it.
    /// @param d unit direction, becomes that in which the light leaves   @param side where d is
    /// @param normal of the fibre there, outward, of unit length and 0 along x   @return where it left to
    Side leave(Vec3& d, Side side, Vec3 normal, sim2d::RandomStream& random, Next next = Next::leave_or_meet) const;

    /// Reflectance at a facet of unit normal n towards `side`, met at the cosine c on that side.
    double reflectance(Vec3 d, Vec3 n, double c, Side side) const;

    double index() const { return eta_; }
    double tilt() const { return tilt_; }          ///< tangent of the scales' tilt
    double slope_along() const { return along_; }  ///< deviation of the slopes
    double slope_around() const { return around_; }

  private:
    /// A facet that d meets, its unit normal towards `side`.
    Vec3 facet(Vec3 d, Side side, Vec3 normal, bool tail, sim2d::RandomStream& random) const;
    bool leaves(Vec3 d, Side side, Vec3 normal, sim2d::RandomStream& random) const;

    double eta_, excess_, layers_, tilt_, along_, around_;
    Reflectance reflectance_;
};

}  // namespace medulla::sim3d
