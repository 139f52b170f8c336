/* scannetpp.c -- ScanNet++ as downloaded (kaldir.vc.in.tum.de/scannetpp/documentation): a scene's folder with
 * dslr/nerfstudio/transforms.json, photographs dslr/resized_images/, masks dslr/resized_anon_masks/ and the mesh
 * scans/mesh_aligned_0.05.ply.
 *
 * The poses are those of ns-process-data, whose x and y are the mesh's y and x, and z its -z, which the file does not
 * say; they are turned back. Photographs marked is_bad are left out, test_frames held out. The same file put flat
 * beside the mesh is known by the mesh's name. Where only the photographs without distortion are there, which the data
 * set's toolkit makes, their own file is read: names are the same, lenses are not. */
#include <string.h>

#include "common/mem.h"
#include "server/ingest/applied_transform.h"
#include "server/ingest/path.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/transforms_file.h"

static const double applied[3][4] = {{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, -1, 0}};

#define UNDISTORTED "dslr/resized_undistorted_images"
#define UNDISTORTED_FILE "dslr/nerfstudio/transforms_undistorted.json"

static char *recognise(const struct listing *l, const char *base) {
    bool is_undistorted =
        listing_has_folder(l, base, UNDISTORTED) && !listing_has_folder(l, base, "dslr/resized_images");
    const struct listed_file *file = is_undistorted ? listing_find(l, base, UNDISTORTED_FILE) : NULL;
    if (!file)
        file = listing_find(l, base, "dslr/nerfstudio/transforms.json");
    if (!file && listing_first(l, base, "mesh_aligned_0.05*.ply"))
        file = listing_find(l, base, "transforms.json");
    return file ? mem_strdup(file->path) : NULL;
}

static bool reads_undistorted(const struct source_place *place) {
    return strcmp(place->found + strlen(place->base), UNDISTORTED_FILE) == 0;
}

/* Masks are in a folder of their own. Those that were not downloaded are done without. */
static void settle_masks(const struct source_place *place, struct frames *t, struct findings *f) {
    bool is_undistorted = reads_undistorted(place);
    const char *const folders[] = {is_undistorted ? "dslr/resized_undistorted_masks/" : "dslr/resized_anon_masks/",
                                   "resized_anon_masks/", "masks/", ""};
    size_t absent_count = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        char **mask = &t->frame[i].mask, *old = *mask;
        *mask = NULL;
        for (size_t k = 0; old && !*mask && k < sizeof folders / sizeof *folders; k++) {
            char *path = mem_printf("%s%s", folders[k], path_base(old));
            const struct listed_file *file = listing_find(place->listing, place->base, path);
            *mask = file ? mem_strdup(file->path) : NULL;
            mem_free(path);
        }
        absent_count += old && !*mask;
        mem_free(old);
    }
    if (absent_count > 0)
        findings_warning(f, "%zu masks of ScanNet++ are not in the bundle: what they hide is used", absent_count);
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    bool is_undistorted = reads_undistorted(place);
    char *folder = is_undistorted ? mem_printf("%s" UNDISTORTED "/", place->base)
                                  : mem_strndup(place->found, (size_t)(path_base(place->found) - place->found));
    enum status status = transforms_file_read(place, place->found, t, f, err);
    settle_masks(place, t, f);
    photo_folder_resolve(place->listing, folder, false, t, f);
    mem_free(t->point_cloud); /* of nerfstudio's axes */
    t->point_cloud = NULL;
    t->has_applied = true;
    t->applied_scale = 1.0;
    memcpy(t->applied, applied, sizeof applied);
    applied_transform_undo(t, place->found, "ScanNet++'s mesh has others", f);
    mem_free(folder);
    return status;
}

const struct source source_scannetpp = {"ScanNet++", recognise, read};
