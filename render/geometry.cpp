#include "render/geometry.hpp"

#include "render/error.hpp"

namespace medulla::render {
namespace {

struct Context {
    RTCIntersectContext embree;  // first: Embree hands its address back to the filter
    Start start;
};

/// Refuses backs and what the ray starts on. `user`: segments of a strand; null for triangles.
void filter(const RTCFilterFunctionNArguments* arguments) {
    const auto& start = reinterpret_cast<const Context*>(arguments->context)->start;
    const auto& ray = *reinterpret_cast<const RTCRay*>(arguments->ray);
    const auto& hit = *reinterpret_cast<const RTCHit*>(arguments->hit);
    bool refused = hit.Ng_x * ray.dir_x + hit.Ng_y * ray.dir_y + hit.Ng_z * ray.dir_z >= 0;
    if (!refused && hit.geomID == start.geometry) {
        if (arguments->geometryUserPtr == nullptr) {
            refused = hit.primID == start.part;
        } else {
            const auto& strands = *static_cast<const Strands*>(arguments->geometryUserPtr);
            const std::uint32_t strand = strands.strand_of[hit.primID];
            refused = strand == start.part &&
                      std::abs(float(hit.primID - strands.first_segment[strand]) + hit.u - start.along) < start.reach;
        }
    }
    if (refused) arguments->valid[0] = 0;
}

RTCRay embree_ray(const Ray& ray, float distance) {
    RTCRay r{};
    r.org_x = ray.origin.x, r.org_y = ray.origin.y, r.org_z = ray.origin.z;
    r.dir_x = ray.direction.x, r.dir_y = ray.direction.y, r.dir_z = ray.direction.z;
    r.tfar = distance;
    r.mask = nothing;
    return r;
}

bool count_memory(void* user, ssize_t bytes, bool) {
    reinterpret_cast<std::atomic<std::int64_t>*>(user)->fetch_add(bytes);
    return true;
}

}  // namespace

Geometry::Geometry(const Scene& scene) {
    device_.reset(rtcNewDevice(nullptr));
    if (device_ == nullptr) throw Error("embree: no device ({})", int(rtcGetDeviceError(nullptr)));
    rtcSetDeviceMemoryMonitorFunction(device_.get(), count_memory, &bytes_);
    scene_.reset(rtcNewScene(device_.get()));
    rtcSetSceneBuildQuality(scene_.get(), RTC_BUILD_QUALITY_HIGH);
    for (const Object& object : scene.objects)
        for (const Layer& layer : object.coat) {
            strands_.push_back(grow(object.shape, layer));
            if (strands_.back().count() == 0) throw Error("coat: expected a surface that grows hair, found none");
        }
    strands_.insert(strands_.end(), scene.strands.begin(), scene.strands.end());
    for (const SingleFibre& fibre : scene.fibres) strands_.push_back(strand_of(fibre));
    for (const Object& object : scene.objects)
        if (object.has_skin) meshes_.push_back(mesh_of(object.shape, object.skin));
    if (scene.ground.present) meshes_.push_back(mesh_of(scene.ground));
    for (Strands& strands : strands_) add(strands);
    for (const Mesh& mesh : meshes_) add(mesh);
    rtcCommitScene(scene_.get());
    if (const RTCError error = rtcGetDeviceError(device_.get()); error != RTC_ERROR_NONE)
        throw Error("embree: error {} while building ({} MB)", int(error), bytes() >> 20);
}

void Geometry::add(Strands& strands) {
    const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE));
    RTCGeometry curves = geometry.get();
    rtcSetSharedGeometryBuffer(curves, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, strands.first_point.data(), 0,
                               sizeof(std::uint32_t), strands.first_point.size());
    strands.points.reserve(strands.points.size() + 1);  // Embree reads 16 bytes at the last point's address and on
    rtcSetSharedGeometryBuffer(curves, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, strands.points.data(), 0,
                               sizeof(CurvePoint), strands.points.size());
    rtcSetGeometryUserData(curves, &strands);
    rtcSetGeometryIntersectFilterFunction(curves, filter);
    rtcSetGeometryOccludedFilterFunction(curves, filter);
    rtcCommitGeometry(curves);
    rtcAttachGeometry(scene_.get(), curves);
}

void Geometry::add(const Mesh& mesh) {
    const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    RTCGeometry triangles = geometry.get();
    auto* points = static_cast<Vec3*>(rtcSetNewGeometryBuffer(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                              sizeof(Vec3), mesh.positions.size()));
    auto* index = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
        triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), mesh.indices.size() / 3));
    if (points == nullptr || index == nullptr) throw Error("embree: no memory for a mesh");
    std::copy(mesh.positions.begin(), mesh.positions.end(), points);
    std::copy(mesh.indices.begin(), mesh.indices.end(), index);
    rtcSetGeometryIntersectFilterFunction(triangles, filter);
    rtcSetGeometryOccludedFilterFunction(triangles, filter);
    rtcCommitGeometry(triangles);
    rtcAttachGeometry(scene_.get(), triangles);
}

Hit Geometry::nearest(const Ray& ray) const {
    Context context;
    rtcInitIntersectContext(&context.embree);
    context.start = ray.start;
    RTCRayHit query;
    query.ray = embree_ray(ray, std::numeric_limits<float>::infinity());
    query.hit.geomID = nothing;
    rtcIntersect1(scene_.get(), &context.embree, &query);
    return {query.ray.tfar, query.hit.geomID, query.hit.primID, query.hit.u, query.hit.v};
}

bool Geometry::blocked(const Ray& ray, float distance) const {
    Context context;
    rtcInitIntersectContext(&context.embree);
    context.start = ray.start;
    RTCRay query = embree_ray(ray, distance);
    rtcOccluded1(scene_.get(), &context.embree, &query);
    return query.tfar < 0;
}

StrandHit Geometry::strand_hit(const Hit& hit) const {
    const Strands& s = strands_[hit.geometry];
    const std::uint32_t strand = s.strand_of[hit.primitive], segment = hit.primitive - s.first_segment[strand];
    const CurvePoint* p = s.points.data() + s.first_point[hit.primitive];
    const float u = hit.u, v = 1 - u;
    // The uniform cubic B-spline and its derivative.
    const float b[4] = {v * v * v / 6, (4 - 6 * u * u + 3 * u * u * u) / 6, (4 - 6 * v * v + 3 * v * v * v) / 6,
                        u * u * u / 6};
    const float d[4] = {-0.5f * v * v, 0.5f * (3 * u * u - 4 * u), 0.5f * (4 * v - 3 * v * v), 0.5f * u * u};
    StrandHit r{};
    Vec3 speed;
    for (int k = 0; k < 4; ++k) {
        const Vec3 q{p[k].x, p[k].y, p[k].z};
        r.axis += b[k] * q, speed += d[k] * q, r.radius += b[k] * p[k].radius;
    }
    float rate = length(speed);
    if (!(rate > 0)) {  // a Bezier end with a doubled control point: the direction just inside
        speed = Vec3{p[3].x, p[3].y, p[3].z} - Vec3{p[0].x, p[0].y, p[0].z};
        rate = length(speed);
    }
    r.tangent = (1 / rate) * speed;
    r.along = (float(segment) + u) / float(s.segments(strand));
    r.strand = strand;
    r.start = {hit.geometry, strand, float(segment) + u, 4 * r.radius / rate};
    return r;
}

SkinHit Geometry::skin_hit(const Hit& hit) const {
    const Mesh& m = meshes_[hit.geometry - strands_.size()];
    const std::uint32_t *i = m.indices.data() + 3 * std::size_t(hit.primitive), a = i[0], b = i[1], c = i[2];
    const SurfacePoint p = m.at(hit.primitive, hit.u, hit.v);
    return {p.position,
            p.normal,
            normalise(cross(m.positions[b] - m.positions[a], m.positions[c] - m.positions[a])),
            m.albedo,
            {hit.geometry, hit.primitive, 0, 0}};
}

std::size_t Geometry::strand_count() const {
    std::size_t sum = 0;
    for (const Strands& strands : strands_) sum += strands.count();
    return sum;
}

}  // namespace medulla::render
