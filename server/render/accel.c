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

#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

/* Above this, triangles are small compared to the room, as in scans. Splitting them for tighter boxes then makes a
 * deeper tree that costs more than it saves (5 % of the total time at 370,000 triangles). */
#define FINE_MESH_TRIANGLES 100000

/* Threads: one builds; ours trace. No AVX-512: packets of 8 are up to 9 % slower with it (Zen 5), and without it
 * machines of both kinds find the same hits, bit by bit. */
#ifdef __x86_64__
#define DEVICE "threads=1,user_threads=1,max_isa=avx2"
#else
#define DEVICE "threads=1,user_threads=1"
#endif

struct accel {
    RTCDevice device;
    RTCScene scene;
};

#if RTC_VERSION_MAJOR >= 4

static void query_intersect(RTCScene scene, struct RTCRayHit *ray) { rtcIntersect1(scene, ray, NULL); }

static void query_occluded(RTCScene scene, struct RTCRay *ray) { rtcOccluded1(scene, ray, NULL); }

static void query_intersect_8(const int *valid, RTCScene scene, struct RTCRayHit8 *ray) {
    rtcIntersect8(valid, scene, ray, NULL);
}

static void query_occluded_8(const int *valid, RTCScene scene, struct RTCRay8 *ray) {
    rtcOccluded8(valid, scene, ray, NULL);
}

static void query_intersect_16_coherent(const int *valid, RTCScene scene, struct RTCRayHit16 *ray) {
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcIntersect16(valid, scene, ray, &arguments);
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

static void query_intersect_8(const int *valid, RTCScene scene, struct RTCRayHit8 *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect8(valid, scene, &context, ray);
}

static void query_occluded_8(const int *valid, RTCScene scene, struct RTCRay8 *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded8(valid, scene, &context, ray);
}

static void query_intersect_16_coherent(const int *valid, RTCScene scene, struct RTCRayHit16 *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &context, ray);
}

#endif

static void no_memory(void) { mem_exhausted("the ray tracing library"); }

/* TBB, which Embree uses, dlopens its allocator, and that one's constructor dlopens itself again. If that fails for
 * lack of memory for the error message, glibc 2.36 takes its out-of-memory marker for an address. So a dlopen that
 * fails and whose message is read comes first, which makes glibc allocate and keep the buffer, and then the allocator
 * is opened. */
static void open_allocator(void) {
    static const char absent[] = "no such thing";
    const char *why = dlsym(RTLD_DEFAULT, absent) ? NULL : dlerror();
    if (why && strcmp(why, "out of memory") == 0)
        no_memory();
    dlsym(RTLD_DEFAULT, absent);           /* dlerror must follow, or the message is freed */
    dlopen("libtbbmalloc.so.2", RTLD_NOW); /* TBB falls back to malloc without it */
}

/* TBB throws std::runtime_error when it cannot make a thread, and nobody catches it. */
static void on_terminate(void) {
    const struct {
        const void *table;
        const char *name;
    } * type; /* std::type_info, as the C++ ABI lays it out */
    void *(*find_type)(void);
    *(void **)&find_type = dlsym(RTLD_DEFAULT, "__cxa_current_exception_type");
    type = find_type ? find_type() : NULL;
    if (type && strcmp(type->name, "St13runtime_error") == 0)
        no_memory();
    abort();
}

/* std::bad_alloc may also be thrown where nobody catches it, which would look like a crash. std::set_new_handler (by
 * its C++ ABI name) reports out of memory before that. */
static void watch_memory(void) {
    void (*(*set_new_handler)(void (*)(void)))(void);
    void (*(*set_terminate)(void (*)(void)))(void);
    open_allocator();
    *(void **)&set_terminate = dlsym(RTLD_DEFAULT, "_ZSt13set_terminatePFvvE");
    if (set_terminate)
        set_terminate(on_terminate);
    *(void **)&set_new_handler = dlsym(RTLD_DEFAULT, "_ZSt15set_new_handlerPFvvE");
    if (set_new_handler)
        set_new_handler(no_memory);
}

/* `code` is from rtcGetDeviceError, which clears it. */
static enum status device_error(enum RTCError code, const char *doing, struct error *err) {
    if (code == RTC_ERROR_OUT_OF_MEMORY)
        no_memory();
    enum status status = code == RTC_ERROR_UNSUPPORTED_CPU ? STATUS_UNAVAILABLE : STATUS_INTERNAL;
    return error_set(err, status, "the ray tracing library failed while %s (its code %d)", doing, (int)code);
}

/* Embree reads 16 bytes per vertex, so vertices are copied: the last vec3 of the mesh may end at a page boundary. */
static bool attach_mesh(RTCGeometry geometry, const struct mesh *mesh) {
    float *position = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(vec3),
                                              mesh->vertex_count);
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

enum status accel_new(struct accel **result, const struct mesh *mesh, struct parallel *pool, struct error *err) {
    (void)pool;
    *result = NULL;
    struct accel *a = mem_calloc(1, sizeof *a);
    enum status status = STATUS_OK;
    RTCGeometry geometry = NULL;
    watch_memory();
    a->device = rtcNewDevice(DEVICE);
    if (!a->device) {
        status = device_error(rtcGetDeviceError(NULL), "starting", err);
        goto out;
    }
    a->scene = rtcNewScene(a->device);
    bool fine = mesh->triangle_count >= FINE_MESH_TRIANGLES;
    rtcSetSceneBuildQuality(a->scene, fine ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH);
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

/* Copies rays[0..count) into a packet of `width` (8 or 16), a structure of arrays; the remaining lanes are masked
 * off. */
#define PACKET_SET(width, packet, rays, count)                                                                         \
    for (size_t lane = 0; lane < (width); lane++) {                                                                    \
        const struct accel_ray *from = &(rays)[lane < (count) ? lane : 0];                                             \
        valid[lane] = lane < (count) ? -1 : 0;                                                                         \
        (packet)->org_x[lane] = from->origin.x;                                                                        \
        (packet)->org_y[lane] = from->origin.y;                                                                        \
        (packet)->org_z[lane] = from->origin.z;                                                                        \
        (packet)->tnear[lane] = from->near_m;                                                                          \
        (packet)->dir_x[lane] = from->direction.x;                                                                     \
        (packet)->dir_y[lane] = from->direction.y;                                                                     \
        (packet)->dir_z[lane] = from->direction.z;                                                                     \
        (packet)->time[lane] = 0.0f;                                                                                   \
        (packet)->tfar[lane] = from->far_m;                                                                            \
        (packet)->mask[lane] = UINT32_MAX;                                                                             \
        (packet)->id[lane] = 0;                                                                                        \
        (packet)->flags[lane] = 0;                                                                                     \
    }

#define PACKET_GET(packet, count, hits)                                                                                \
    for (size_t lane = 0; lane < (count); lane++) {                                                                    \
        bool missed = (packet)->hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID;                                           \
        (hits)[lane].distance_m = (packet)->ray.tfar[lane];                                                            \
        (hits)[lane].triangle = missed ? ACCEL_NONE : (packet)->hit.primID[lane];                                      \
        (hits)[lane].b1 = (packet)->hit.u[lane];                                                                       \
        (hits)[lane].b2 = (packet)->hit.v[lane];                                                                       \
    }

/* Whether sixteen rays share their origin and are within about 15 degrees of the first. Embree's frustum traversal
 * takes half the time for such rays and twice the time for others. */
static bool is_coherent(const struct accel_ray *ray) {
    const struct accel_ray *a = &ray[0];
    bool coherent = true;
    for (int i = 1; i < 16; i++)
        coherent = coherent && ray[i].origin.x == a->origin.x && ray[i].origin.y == a->origin.y &&
                   ray[i].origin.z == a->origin.z && vec3_dot(ray[i].direction, a->direction) > 0.96f;
    return coherent;
}

void accel_intersect_many(const struct accel *a, size_t count, const struct accel_ray *ray, struct accel_hit *hit) {
    _Alignas(64) int valid[16];
    for (size_t i = 0; i < count;) {
        if (count - i >= 16 && is_coherent(ray + i)) {
            struct RTCRayHit16 packet;
            PACKET_SET(16, &packet.ray, ray + i, 16)
            memset(packet.hit.geomID, 0xff, sizeof packet.hit.geomID);
            memset(packet.hit.instID, 0xff, sizeof packet.hit.instID);
            query_intersect_16_coherent(valid, a->scene, &packet);
            PACKET_GET(&packet, 16, hit + i)
            i += 16;
            continue;
        }
        size_t lanes = count - i < 8 ? count - i : 8;
        struct RTCRayHit8 packet;
        PACKET_SET(8, &packet.ray, ray + i, lanes)
        memset(packet.hit.geomID, 0xff, sizeof packet.hit.geomID);
        memset(packet.hit.instID, 0xff, sizeof packet.hit.instID);
        query_intersect_8(valid, a->scene, &packet);
        PACKET_GET(&packet, lanes, hit + i)
        i += lanes;
    }
}

void accel_occluded_many(const struct accel *a, size_t count, const struct accel_ray *ray, uint8_t *occluded) {
    _Alignas(32) int valid[8];
    for (size_t i = 0; i < count; i += 8) {
        size_t lanes = count - i < 8 ? count - i : 8;
        struct RTCRay8 packet;
        PACKET_SET(8, &packet, ray + i, lanes)
        query_occluded_8(valid, a->scene, &packet);
        for (size_t lane = 0; lane < lanes; lane++)
            occluded[i + lane] = packet.tfar[lane] < 0.0f;
    }
}

const char *accel_library_version(void) { return "Embree " RTC_VERSION_STRING; }
