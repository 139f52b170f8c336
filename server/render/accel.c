/* accel.c -- see accel.h. Embree 3 or 4, whichever is installed; the only include of either.
 *
 * The two differ, for what is used here, in the name of the header and in how a query's
 * options are passed; the functions query_* hide it. */
#include "server/render/accel.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "common/mem.h"

struct accel {
    RTCDevice device;
    RTCScene scene;
};

#if RTC_VERSION_MAJOR >= 4

static void query_intersect(RTCScene scene, struct RTCRayHit *ray) {
    rtcIntersect1(scene, ray, NULL);
}

static void query_occluded(RTCScene scene, struct RTCRay *ray) {
    rtcOccluded1(scene, ray, NULL);
}

#else

static void query_intersect(RTCScene scene, struct RTCRayHit *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, ray);
}

static void query_occluded(RTCScene scene, struct RTCRay *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, ray);
}

#endif

/* `code` is what rtcGetDeviceError told: asking clears it. */
static enum status device_error(enum RTCError code, const char *doing, struct error *err) {
    if (code == RTC_ERROR_OUT_OF_MEMORY)
        mem_exhausted("the ray tracing library");
    enum status status = code == RTC_ERROR_UNSUPPORTED_CPU ? STATUS_UNAVAILABLE : STATUS_INTERNAL;
    return error_set(err, status, "the ray tracing library failed while %s (its code %d)", doing,
                     (int)code);
}

/* Embree reads 16 bytes per vertex: a buffer of its own, since the last vec3 of ours may be
 * followed by the end of a page. */
static bool attach_mesh(RTCGeometry geometry, const struct mesh *mesh) {
    float *position = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                              RTC_FORMAT_FLOAT3, sizeof(vec3), mesh->vertex_count);
    if (!position)
        return false;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        position[3 * i] = mesh->position[i].x;
        position[3 * i + 1] = mesh->position[i].y;
        position[3 * i + 2] = mesh->position[i].z;
    }
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->index, 0,
                               sizeof mesh->index[0], mesh->triangle_count);
    rtcCommitGeometry(geometry);
    return true;
}

enum status accel_new(struct accel **result, const struct mesh *mesh, struct parallel *pool,
                      struct error *err) {
    (void)pool;
    *result = NULL;
    struct accel *a = mem_calloc(1, sizeof *a);
    enum status status = STATUS_OK;
    RTCGeometry geometry = NULL;
    a->device = rtcNewDevice("threads=1,user_threads=1");
    if (!a->device) {
        status = device_error(rtcGetDeviceError(NULL), "starting", err);
        goto out;
    }
    a->scene = rtcNewScene(a->device);
    rtcSetSceneBuildQuality(a->scene, RTC_BUILD_QUALITY_HIGH);
    geometry = rtcNewGeometry(a->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!attach_mesh(geometry, mesh)) {
        status = device_error(rtcGetDeviceError(a->device), "taking the mesh", err);
        goto out;
    }
    rtcAttachGeometryByID(a->scene, geometry, 0);
    rtcCommitScene(a->scene);
    enum RTCError built = rtcGetDeviceError(a->device);
    if (built != RTC_ERROR_NONE) {
        status = device_error(built, "building the acceleration structure", err);
        goto out;
    }
    *result = a;
    a = NULL;
out:
    if (geometry)
        rtcReleaseGeometry(geometry);
    accel_free(a);
    return status;
}

void accel_free(struct accel *a) {
    if (!a)
        return;
    if (a->scene)
        rtcReleaseScene(a->scene);
    if (a->device)
        rtcReleaseDevice(a->device);
    mem_free(a);
}

static void ray_set(struct RTCRay *r, vec3 origin, vec3 direction, float near_m, float far_m) {
    r->org_x = origin.x;
    r->org_y = origin.y;
    r->org_z = origin.z;
    r->tnear = near_m;
    r->dir_x = direction.x;
    r->dir_y = direction.y;
    r->dir_z = direction.z;
    r->time = 0.0f;
    r->tfar = far_m;
    r->mask = UINT32_MAX;
    r->id = 0;
    r->flags = 0;
}

bool accel_intersect(const struct accel *a, vec3 origin, vec3 direction, float near_m, float far_m,
                     struct accel_hit *hit) {
    struct RTCRayHit r;
    ray_set(&r.ray, origin, direction, near_m, far_m);
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    query_intersect(a->scene, &r);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    *hit = (struct accel_hit){r.ray.tfar, r.hit.primID, r.hit.u, r.hit.v};
    return true;
}

bool accel_occluded(const struct accel *a, vec3 origin, vec3 direction, float near_m, float far_m) {
    struct RTCRay r;
    ray_set(&r, origin, direction, near_m, far_m);
    query_occluded(a->scene, &r);
    return r.tfar < 0.0f;
}

void accel_intersect_many(const struct accel *a, size_t count, const struct accel_ray *ray,
                          struct accel_hit *hit) {
    for (size_t i = 0; i < count; i++)
        if (!accel_intersect(a, ray[i].origin, ray[i].direction, ray[i].near_m, ray[i].far_m, &hit[i]))
            hit[i].triangle = ACCEL_NONE;
}

void accel_occluded_many(const struct accel *a, size_t count, const struct accel_ray *ray,
                         uint8_t *occluded) {
    for (size_t i = 0; i < count; i++)
        occluded[i] = accel_occluded(a, ray[i].origin, ray[i].direction, ray[i].near_m, ray[i].far_m);
}

const char *accel_library_version(void) {
    return "Embree " RTC_VERSION_STRING;
}
