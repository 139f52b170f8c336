/* test_sources.c -- captures of the demo room as different tools lay them out: every source finds the poses that the
 * room's own transforms.json has, and with the mesh beside them. The captures keep a tenth of a millimetre at least. */
#include "server/ingest/bundle.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

static struct parallel *pool;
static char *captures;

static bool load(const char *name, const struct reading *reading, struct scene *scene) {
    struct bundle_limits limits = bundle_default_limits();
    struct error err = {.message = ""};
    cJSON *problems = cJSON_CreateArray();
    char *dir = file_join(captures, name);
    bool ok = bundle_load(dir, reading, &limits, pool, scene, problems, &err) == STATUS_OK;
    CHECK_THAT(ok, "%s: %s", name, err.message);
    if (!ok)
        scene_release(scene);
    cJSON_Delete(problems);
    mem_free(dir);
    return ok;
}

static double difference(const struct rigid *a, const struct rigid *b) {
    double worst = fmax(
        fabs((double)(a->translation.x - b->translation.x)),
        fmax(fabs((double)(a->translation.y - b->translation.y)), fabs((double)(a->translation.z - b->translation.z))));
    for (int i = 0; i < 9; i++)
        worst = fmax(worst, fabs((double)(a->rotation[i / 3][i % 3] - b->rotation[i / 3][i % 3])));
    return worst;
}

/* Photograph i of the capture, which repeats them after `period`, has the pose of photograph i of the truth, and its
 * lens within `lens_tolerance` pixels. */
static void check_same(const struct scene *truth, const char *name, const char *source, size_t period,
                       double lens_tolerance) {
    struct scene scene;
    if (!load(name, NULL, &scene))
        return;
    CHECK_STRING(scene.source, source);
    for (size_t i = 0; i < scene.photograph_count; i++) {
        const struct camera *a = &scene.photograph[i].camera, *b = &truth->photograph[i % period].camera;
        double d = difference(&a->world_from_camera, &b->world_from_camera);
        CHECK_THAT(d < 1e-4, "%s: pose %zu is off by %g", name, i, d);
        CHECK_THAT(fabs((double)(a->fx - b->fx)) < lens_tolerance && fabs((double)(a->cx - b->cx)) < lens_tolerance &&
                       fabs((double)(a->cy - b->cy)) < lens_tolerance,
                   "%s: the lens is %g, %g, %g, not %g, %g, %g", name, (double)a->fx, (double)a->cx, (double)a->cy,
                   (double)b->fx, (double)b->cx, (double)b->cy);
    }
    scene_release(&scene);
}

int main(void) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    captures = mem_printf("%s/captures", root ? root : "../shared/data");
    if (access(captures, R_OK) != 0)
        CHECK_SKIP("no test data at %s", captures);
    struct scene truth;
    pool = parallel_new(2);
    if (load("ns_case", NULL, &truth)) {
        check_same(&truth, "ns_nested2", "nerfstudio transforms.json", 6, 1e-3);
        check_same(&truth, "ns_dotdot", "nerfstudio transforms.json", 6, 1e-3);
        check_same(&truth, "src_nerf_synthetic", "transforms_train.json of NeRF's synthetic scenes", 3, 60.0);
        check_same(&truth, "cm_dense0", "COLMAP", 6, 1e-3);
        check_same(&truth, "cm_nopointsline", "COLMAP", 6, 1e-3);
        check_same(&truth, "cm_photos_in_photos", "COLMAP", 6, 1e-3);
        check_same(&truth, "src_openmvs", "COLMAP", 6, 1e-3);
        check_same(&truth, "src_polycam_raw", "Polycam raw data", 6, 0.3);
        check_same(&truth, "src_polycam_nsprocess", "nerfstudio transforms.json", 6, 1e-3);
        check_same(&truth, "src_scannetpp", "ScanNet++", 6, 0.3);
        check_same(&truth, "src_scannetpp_flat", "ScanNet++", 6, 0.3);
        check_same(&truth, "src_scannet_one", "ScanNet", 6, 0.1);
        check_same(&truth, "src_replica_joined", "NICE-SLAM's Replica", 6, 0.6);
        check_same(&truth, "src_replica_niceslam_root", "NICE-SLAM's Replica", 6, 0.6);
        scene_release(&truth);
    }
    parallel_free(pool);
    mem_free(captures);
    return check_result();
}
