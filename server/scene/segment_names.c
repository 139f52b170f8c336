/* segment_names.c -- see segment_names.h. The object that most of a segment's area belongs to is found by Boyer and
 * Moore's majority vote (1981), with areas as the votes, and then weighed. */
#include "server/scene/segment_names.h"

#include "common/mem.h"

/* Of a segment's area, in the object that it is called after. Not all of it: regions that are too small to be segments
 * join a neighbour of another object. */
#define MIN_SHARE 0.9

struct vote {
    int64_t object; /* that leads */
    double lead;    /* m^2 */
};

static double area_of(const struct mesh *mesh, size_t t) { return 0.5 * (double)vec3_length(mesh_cross(mesh, t)); }

/* The objects that may have more than half of each segment; [count], the caller's. */
static struct vote *elect(const uint32_t *of_triangle, size_t count, const struct mesh *mesh) {
    struct vote *vote = mem_calloc(count, sizeof *vote);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        struct vote *v = &vote[of_triangle[t]];
        double area = area_of(mesh, t);
        if (v->object == mesh->object_id[t]) {
            v->lead += area;
        } else if (v->lead >= area) {
            v->lead -= area;
        } else {
            v->object = mesh->object_id[t];
            v->lead = area - v->lead;
        }
    }
    return vote;
}

/* The object's name for each segment that lies in it; [count], borrowed from the mesh, the array the caller's. */
static const char **find_objects(const uint32_t *of_triangle, size_t count, const struct mesh *mesh, int64_t *object) {
    struct vote *vote = elect(of_triangle, count, mesh);
    double *inside = mem_calloc(count, sizeof *inside), *whole = mem_calloc(count, sizeof *whole);
    const char **name = mem_calloc(count, sizeof *name);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t s = of_triangle[t];
        double area = area_of(mesh, t);
        whole[s] += area;
        inside[s] += mesh->object_id[t] == vote[s].object ? area : 0.0;
    }
    for (size_t s = 0; s < count; s++) {
        object[s] = vote[s].object;
        name[s] = inside[s] >= MIN_SHARE * whole[s] ? mesh_object_name(mesh, object[s]) : NULL;
    }
    mem_free(whole);
    mem_free(inside);
    mem_free(vote);
    return name;
}

char **segment_names_make(const uint32_t *of_triangle, size_t count, const struct mesh *mesh) {
    if (!mesh->object_id || mesh->name_count == 0)
        return NULL;
    int64_t *object = mem_array(count, sizeof *object);
    const char **own = find_objects(of_triangle, count, mesh, object);
    size_t *several = mem_calloc(mesh->name_count, sizeof *several),
           *number = mem_calloc(mesh->name_count, sizeof *number);
    char **name = mem_calloc(count, sizeof *name);
    for (size_t s = 0; s < count; s++)
        if (own[s])
            several[object[s]]++;
    for (size_t s = 0; s < count; s++)
        if (own[s])
            name[s] = several[object[s]] == 1 ? mem_printf("%s", own[s])
                                              : mem_printf("%s (%zu)", own[s], ++number[object[s]]);
    mem_free(number);
    mem_free(several);
    mem_free(own);
    mem_free(object);
    return name;
}
