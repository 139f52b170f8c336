/* grey_card.c -- see grey_card.h. */
#include "server/capture/grey_card.h"

#include <math.h>
#include <string.h>

/* By its name, or by the last part of that where no other photograph has the same; NULL: none. */
static const struct photograph *find(const struct scene *scene, const char *name) {
    const struct photograph *found = NULL;
    size_t count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *photo = &scene->photograph[i];
        const char *slash = strrchr(photo->name, '/');
        if (strcmp(photo->name, name) == 0)
            return photo;
        if (slash && strcmp(slash + 1, name) == 0) {
            found = photo;
            count++;
        }
    }
    return count == 1 ? found : NULL;
}

enum status grey_card_find(struct grey_card *card, const struct pixel_setting *pixel, const struct scene *scene,
                           const struct surface *surface, const struct accel *accel, struct error *err) {
    const struct photograph *photo = find(scene, pixel->photograph);
    struct accel_hit hit;
    vec3 direction;
    *card = (struct grey_card){.is_given = true, .pixel = *pixel};
    if (!photo) {
        error_set(err, STATUS_INPUT, "grey_card: there is no photograph %s, or more than one", pixel->photograph);
        return error_hint(err, "name it by its path in the bundle, as images/IMG_12.jpg");
    }
    const struct camera camera = photograph_file_camera(photo);
    if (pixel->x >= camera.width || pixel->y >= camera.height)
        return error_set(err, STATUS_INPUT, "grey_card: %s has %u x %u pixels, none at %u, %u", pixel->photograph,
                         camera.width, camera.height, pixel->x, pixel->y);
    vec3 origin = camera_origin(&camera);
    if (!camera_direction(&camera, (float)pixel->x + 0.5f, (float)pixel->y + 0.5f, &direction) ||
        !accel_intersect(accel, origin, direction, 0.0f, INFINITY, &hit)) {
        error_set(err, STATUS_INPUT, "grey_card: pixel %u, %u of %s shows nothing of the mesh", pixel->x, pixel->y,
                  pixel->photograph);
        return error_hint(err, "name a pixel of another photograph that shows the card; x is the column, y the row");
    }
    vec2 at = atlas_point(surface->atlas, hit.triangle, hit.b1, hit.b2);
    uint32_t width = surface->inverse->width, height = surface->inverse->height;
    uint32_t column = (uint32_t)clampf(at.x, 0.0f, (float)width - 1.0f);
    uint32_t row = (uint32_t)clampf(at.y, 0.0f, (float)height - 1.0f);
    card->triangle = hit.triangle;
    card->point = vec3_mad(origin, hit.distance_m, direction);
    card->texel = row * width + column;
    if (surface->inverse->triangle[card->texel] == INVERSE_UV_NONE) {
        error_set(err, STATUS_INPUT,
                  "grey_card: pixel %u, %u of %s shows a part of the mesh that is smaller than a texel", pixel->x,
                  pixel->y, pixel->photograph);
        return error_hint(err, "name a pixel nearer to the card's middle, or take a larger texture_size");
    }
    return STATUS_OK;
}
