/* metashape.c -- Agisoft Metashape's "Export Cameras", XML (Metashape manual, appendices C and D).
 *
 * A camera's transform is camera-to-chunk, 4 x 4, row-major, with our camera axes; the chunk's transform (or, since
 * 2.0, the camera's component's) takes it to the coordinates in which models are exported. That of a georeferenced
 * chunk leads to geocentric coordinates, in which models are seldom exported: theirs may also be the chunk's own
 * ("chunk"), have their origin in the chunk's region, x to the east and z up ("local"), or be easting, northing and
 * height above the ellipsoid of UTM ("projected"). A model in another projected system, or with heights above the sea,
 * fits none of these.
 *
 * Distortion: k1 to k4 of even powers, p1 (r^2 + 2 x^2) + 2 p2 x y for x: OpenCV's with p1 and p2 exchanged; cx, cy
 * from the picture's centre; fx = f + b1. A fisheye has the same of x and y scaled to the angle from the axis, which
 * with p1 and p2 is COLMAP's THIN_PRISM_FISHEYE. b2 (skew) and p3, p4 (of higher order of p1, p2) are not modelled:
 * what they are at the picture's corner is told. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/geodesy.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"
#include "server/ingest/source/xml.h"

/* Millions of metres from the origin: the centre of the Earth, 6.4 million metres below. */
#define GEOCENTRIC_M 5e6

/* By what it begins with: its name is the user's. */
static char *recognise(const struct listing *l, const char *base) {
    return listing_first_with(l, base, "*.xml", "<document", "<chunk");
}

static double value_of(const struct xml_node *node, const char *name, double fallback) {
    const struct xml_node *child = xml_child(node, name);
    double value;
    return child && numbers_parse(child->text, 1, &value) ? value : fallback;
}

/* The child of that name whose attribute `key` is `id`; NULL: none. */
static struct xml_node *of_id(const struct xml_node *parent, const char *name, const char *key, const char *id) {
    struct xml_node *child = xml_child(parent, name);
    while (child) {
        const char *own = xml_attribute(child, key);
        if (own && id && strcmp(own, id) == 0)
            return child;
        child = xml_next(child, name);
    }
    return NULL;
}

/* What is counted over all cameras of a file. */
struct meta_counts {
    size_t unposed_count;
    double left_out_px; /* most that a parameter which is not modelled moves a pixel */
};

#define LEFT_OUT_TOLD_PX 0.5 /* below, it is less than the noise of any alignment */

/* Pixels that skew and the higher orders of tangential distortion move the corner of the picture. */
static double left_out(const struct xml_node *c, const struct lens *lens) {
    double x = 0.5 * lens->width / lens->fl_y, y = 0.5 * lens->height / lens->fl_y, r2 = x * x + y * y;
    double skew = value_of(c, "b2", value_of(c, "skew", 0.0)) * y;
    double share = value_of(c, "p3", 0.0) * r2 + value_of(c, "p4", 0.0) * r2 * r2;
    double tangential = 3.0 * hypot(lens->p[0], lens->p[1]) * r2 * share * lens->fl_y;
    return fabs(skew) + fabs(tangential);
}

/* Focal length in y of a calibration, and what that in x has more; before version 1.2 both were written. NAN: none. */
static double read_focal(const struct xml_node *c, double *more) {
    double fx = value_of(c, "fx", NAN), fy = value_of(c, "fy", NAN);
    *more = isnan(fx) || isnan(fy) ? value_of(c, "b1", 0.0) : fx - fy;
    return value_of(c, "f", fy);
}

static bool is_type(const char *type, const char *name) { return type && strcmp(type, name) == 0; }

/* STATUS_INPUT for sensors that are neither frame nor equidistant fisheye cameras. */
static enum status read_sensor(const struct xml_node *sensor, const char *name, struct lens *lens,
                               struct meta_counts *counts, struct error *err) {
    const char *type = xml_attribute(sensor, "type");
    bool is_fisheye = is_type(type, "fisheye") || is_type(type, "equidistant_fisheye");
    struct xml_node *resolution = xml_child(sensor, "resolution");
    struct xml_node *c = of_id(sensor, "calibration", "class", "adjusted");
    double width = NAN, height = NAN, f, more;
    c = c ? c : xml_child(sensor, "calibration");
    if (!c || !resolution || !numbers_parse(xml_attribute(resolution, "width"), 1, &width) ||
        !numbers_parse(xml_attribute(resolution, "height"), 1, &height) || isnan(f = read_focal(c, &more)))
        return error_set(err, STATUS_INPUT, "%s: a sensor has no calibration: the photographs are not aligned", name);
    if (type && !is_fisheye && !is_type(type, "frame")) {
        error_set(err, STATUS_INPUT, "%s: cameras of type %.40s are not read", name, type);
        return error_hint(err, "export undistorted photographs with their cameras (Export, Undistort Photos)");
    }
    *lens = lens_pinhole(width, height, f + more, f, 0.5 * width + value_of(c, "cx", 0.0),
                         0.5 * height + value_of(c, "cy", 0.0));
    lens->k[0] = value_of(c, "k1", 0.0);
    lens->k[1] = value_of(c, "k2", 0.0);
    lens->k[2] = value_of(c, "k3", 0.0);
    lens->p[0] = value_of(c, "p2", 0.0);
    lens->p[1] = value_of(c, "p1", 0.0);
    *(is_fisheye ? &lens->k[3] : &lens->k8) = value_of(c, "k4", 0.0);
    if (is_fisheye)
        lens->model = lens->p[0] != 0.0 || lens->p[1] != 0.0 ? CAMERA_THIN_PRISM_FISHEYE : CAMERA_OPENCV_FISHEYE;
    counts->left_out_px = fmax(counts->left_out_px, left_out(c, lens));
    return STATUS_OK;
}

/* The projected system that the chunk's reference names last, which is the whole's; else that of the place. */
static struct utm utm_of(const struct xml_node *chunk, const double place[3]) {
    static const char mark[] = "AUTHORITY[\"EPSG\",\"";
    const struct xml_node *reference = xml_child(chunk, "reference");
    const char *at = reference ? reference->text : "", *last = NULL;
    struct utm utm;
    while ((at = strstr(at, mark)) != NULL)
        last = at += sizeof mark - 1;
    return last && geodesy_utm_of_epsg(atoi(last), &utm) ? utm : geodesy_utm_at(place);
}

/* What a model of a georeferenced chunk may be in. */
static void know_coordinates(const struct xml_node *chunk, const double geocentric[3][4], struct frames *t) {
    struct xml_node *centre = xml_child(xml_child(chunk, "region"), "center");
    double at[3] = {0}, placed[3], local[3][4], projected[3][4];
    if (centre && !numbers_parse(centre->text, 3, at))
        memset(at, 0, sizeof at);
    for (int i = 0; i < 3; i++)
        placed[i] = geocentric[i][0] * at[0] + geocentric[i][1] * at[1] + geocentric[i][2] * at[2] + geocentric[i][3];
    geodesy_from_local(placed, local);
    const struct utm utm = utm_of(chunk, placed);
    geodesy_from_utm(placed, &utm, projected);
    frames_add_coordinates(t, "chunk", "the chunk's own", geocentric);
    frames_add_coordinates(t, "local", "local ones with the origin in the chunk's region", (const double(*)[4])local);
    frames_add_coordinates(t, "projected", "easting, northing and height of UTM", (const double(*)[4])projected);
    t->is_placed_by_mesh = true;
}

static bool is_geocentric(const double m[3][4]) { return hypot(hypot(m[0][3], m[1][3]), m[2][3]) > GEOCENTRIC_M; }

/* World from chunk: scale * rotation and translation, of a <transform>; identity where it has none. */
static enum status read_chunk(const struct xml_node *transform, const char *name, double m[3][4], struct error *err) {
    const struct xml_node *rotation = xml_child(transform, "rotation"),
                          *translation = xml_child(transform, "translation");
    double r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {0}, scale = value_of(transform, "scale", 1.0);
    if ((rotation && !numbers_parse(rotation->text, 9, r)) || (translation && !numbers_parse(translation->text, 3, t)))
        return error_set(err, STATUS_INPUT, "%s: the chunk's transform is not 9 numbers and 3", name);
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = i % 4 < 3 ? scale * r[3 * (i / 4) + i % 4] : t[i / 4];
    return STATUS_OK;
}

/* The pose in the model's world: the chunk's scale goes to the position only. */
static void place_camera(double chunk[3][4], double camera[4][4], double m[3][4]) {
    double scale = sqrt(chunk[0][0] * chunk[0][0] + chunk[1][0] * chunk[1][0] + chunk[2][0] * chunk[2][0]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            double sum = chunk[i][0] * camera[0][j] + chunk[i][1] * camera[1][j] + chunk[i][2] * camera[2][j];
            m[i][j] = j < 3 ? sum / scale : sum + chunk[i][3];
        }
}

static enum status read_camera(struct xml_node *chunk, struct xml_node *camera, struct frame_list *list,
                               struct meta_counts *counts, struct error *err) {
    const char *label = xml_attribute(camera, "label"), *enabled = xml_attribute(camera, "enabled");
    struct xml_node *transform = xml_child(camera, "transform");
    struct xml_node *sensor = of_id(xml_child(chunk, "sensors"), "sensor", "id", xml_attribute(camera, "sensor_id"));
    struct xml_node *component =
        of_id(xml_child(chunk, "components"), "component", "id", xml_attribute(camera, "component_id"));
    struct xml_node *outer = xml_child(component, "transform");
    double own[4][4], placed[3][4], m[3][4];
    struct lens lens;
    if (enabled && (strcmp(enabled, "false") == 0 || strcmp(enabled, "0") == 0))
        return STATUS_OK;
    if (!label || !transform || !sensor) {
        counts->unposed_count++;
        return STATUS_OK;
    }
    if (!numbers_parse(transform->text, 16, own[0]))
        return error_set(err, STATUS_INPUT, "%s: the transform of %.200s is not 16 numbers", list->name, label);
    enum status status = read_sensor(sensor, list->name, &lens, counts, err);
    if (status == STATUS_OK)
        status = read_chunk(outer ? outer : xml_child(chunk, "transform"), list->name, placed, err);
    if (status != STATUS_OK)
        return status;
    place_camera(placed, own, m);
    if (is_geocentric((const double(*)[4])placed) && list->t->other_count == 0)
        know_coordinates(chunk, (const double(*)[4])placed, list->t);
    return frame_list_add(list, m, &lens, label, label, NULL, err);
}

/* All cameras, also those in groups. */
static enum status read_cameras(struct xml_node *chunk, struct xml_node *parent, struct frame_list *list,
                                struct meta_counts *counts, struct error *err) {
    enum status status = STATUS_OK;
    for (struct xml_node *node = parent ? parent->first : NULL; node && status == STATUS_OK; node = node->next) {
        if (strcmp(node->name, "camera") == 0)
            status = read_camera(chunk, node, list, counts, err);
        else if (strcmp(node->name, "group") == 0)
            status = read_cameras(chunk, node, list, counts, err);
    }
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct mapping file;
    struct error own;
    struct xml_node *root = NULL;
    struct meta_counts counts = {0};
    enum status status = listing_open(place->listing, place->found, "an XML file", &file, &own);
    if (status == STATUS_OK)
        status = xml_parse(file.data, file.size, place->found, &root, &own);
    mapping_close(&file);
    struct xml_node *chunk = xml_find(root, "chunk");
    if (status == STATUS_OK)
        status = read_cameras(chunk, xml_child(chunk, "cameras"), &list, &counts, &own);
    xml_free(root);
    frame_list_finish(&list);
    frame_list_warn_unposed(&list, counts.unposed_count);
    if (counts.left_out_px > LEFT_OUT_TOLD_PX)
        findings_warning(f,
                         "%s: b2 (skew), p3 and p4 are not modelled, which moves the photographs' corners by %.2g "
                         "pixels: optimise the cameras without them, or export undistorted photographs",
                         place->found, counts.left_out_px);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_metashape = {"Metashape", recognise, read};
