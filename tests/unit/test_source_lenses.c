/* test_source_lenses.c -- every lens that a source knows: where a point is seen, against what the tool that writes it
 * documents. The pixels were computed from the tools' formulas, apart from this program. What is not modelled is
 * refused or told, never left out. */
#include "tests/unit/source_rig.h"

/* Of pictures of 160 x 120 pixels; poses are the identity. */
#define ALICE(version, lens)                                                                                           \
    "{\"version\":[" version "],\"views\":[{\"poseId\":\"1\",\"intrinsicId\":\"9\",\"path\":\"b.jpg\"}],"              \
    "\"intrinsics\":[{\"intrinsicId\":\"9\",\"width\":\"160\",\"height\":\"120\"," lens "}],"                          \
    "\"poses\":[{\"poseId\":\"1\",\"pose\":{\"transform\":{\"rotation\":[1,0,0,0,1,0,0,0,1],\"center\":[0,0,0]}}}]}"
#define META(type, calibration)                                                                                        \
    "<document><chunk><sensors><sensor id=\"0\" type=\"" type                                                          \
    "\"><resolution width=\"160\" height=\"120\"/><calibration type=\"" type "\" class=\"adjusted\">" calibration      \
    "</calibration></sensor></sensors><cameras><camera id=\"0\" sensor_id=\"0\" label=\"b\">"                          \
    "<transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera></cameras></chunk></document>"
#define MVG(type, distortion)                                                                                          \
    "{\"views\":[{\"key\":0,\"value\":{\"ptr_wrapper\":{\"data\":{\"filename\":\"b.jpg\",\"id_intrinsic\":7,"          \
    "\"id_pose\":3}}}}],\"intrinsics\":[{\"key\":7,\"value\":{\"polymorphic_name\":\"" type                            \
    "\",\"ptr_wrapper\":{\"data\":{\"width\":160,\"height\":120,\"focal_length\":104,\"principal_point\":[81,62]"      \
    "" distortion "}}}}],\"extrinsics\":[{\"key\":3,\"value\":{\"rotation\":[[1,0,0],[0,1,0],[0,0,1]],"                \
    "\"center\":[0,0,0]}}]}"
#define SFM(lens)                                                                                                      \
    "[{\"cameras\":{\"v2\":{\"width\":160,\"height\":120," lens "}},\"shots\":{\"b.jpg\":{\"camera\":\"v2\","          \
    "\"rotation\":[0,0,0],\"translation\":[0,0,0]}}}]"
#define RC(distortion)                                                                                                 \
    "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\nb.jpg,0,0,0,0,0,0,23.4,0.225,0.45," distortion "\n"
#define XMP(model, attributes, distortion)                                                                             \
    "<rdf:RDF><rdf:Description xcr:FocalLength35mm=\"23.4\" xcr:PrincipalPointU=\"0.00625\" "                          \
    "xcr:PrincipalPointV=\"0.0125\" " attributes "><xcr:DistortionModel>" model "</xcr:DistortionModel>"               \
    "<xcr:Rotation>1 0 0 0 1 0 0 0 1</xcr:Rotation><xcr:Position>0 0 0</xcr:Position>"                                 \
    "<xcr:DistortionCoeficients>" distortion "</xcr:DistortionCoeficients></rdf:Description></rdf:RDF>"
#define NERF(members)                                                                                                  \
    "{\"w\":160,\"h\":120,\"fl_x\":104," members "\"frames\":[{\"file_path\":\"b.jpg\",\"transform_matrix\":"          \
    "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}"
#define ALICE_MM(distortion)                                                                                           \
    ALICE("1,2,8", "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"principalPoint\":[\"1\",\"2\"]," distortion)

static struct source_rig rig;

static void put(const char *source, const char *path, const char *text) {
    source_rig_start(&rig, source);
    source_rig_put(&rig, "b.jpg", "");
    source_rig_put(&rig, "list.txt", "b.jpg\n");
    source_rig_put(&rig, path, text);
}

/* --- what is seen where ----------------------------------------------------------------------- */

static const vec3 point = {0.31f, -0.22f, 0.9f}; /* in the camera */

static const struct lens_row {
    const char *source, *path, *text;
    double x, y; /* pixels */
} rows[] = {
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"none\",\"distortionParams\":\"\""),
     116.8222, 36.5778},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"radialk1\",\"distortionParams\":[\"0.1\"]"),
     117.4613, 36.1243},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"radialk3\",\"distortionParams\":[\"0.1\",\"0.02\",\"0.01\"]"),
     117.4861, 36.1066},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"radialk3pt\",\"distortionParams\":[\"0.1\",\"0.02\",\"0.01\"]"),
     113.2886, 39.0855},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"brown\",\"distortionParams\":[\"0.1\",\"0.02\",\"0.01\",\"0.03\",\"-0.04\"]"),
     115.2315, 37.7366},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"fisheye4\",\"distortionParams\":[\"0.1\",\"0.02\",\"0.01\",\"0.05\"]"),
     115.4556, 37.5476},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"fisheye1\",\"distortionParams\":[\"0.8\"]"),
     117.3666, 36.1915},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,3",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"fisheye1\",\"distortionParams\":[\"0.8\"]"),
     117.3666, 36.1915},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,8",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1.25\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\",\"distortionType\":\"none\""),
     116.8222, 30.2222},
    {"Meshroom", "cameras.sfm",
     ALICE(
         "1,2,4",
         "\"focalLength\":\"23.4\",\"sensorWidth\":\"36\",\"pixelRatio\":\"1.25\",\"principalPoint\":[\"1\",\"2\"],\"type\":\"pinhole\""),
     116.8222, 41.6622},
    {"Meshroom", "cameras.sfm",
     ALICE("1,2,0", "\"pxFocalLength\":[\"104\",\"106\"],\"principalPoint\":[\"20\",\"10\"],\"type\":\"pinhole\""),
     55.8222, -15.9111},
    {"Meshroom", "cameras.sfm",
     ALICE("1,2,1", "\"pxFocalLength\":[\"104\",\"106\"],\"principalPoint\":[\"-20\",\"10\"],\"type\":\"pinhole\""),
     95.8222, 44.0889},
    {"Metashape", "c.xml",
     META(
         "frame",
         "<f>104</f><cx>1</cx><cy>2</cy><b1>3</b1><k1>0.1</k1><k2>0.02</k2><k3>0.01</k3><k4>0.05</k4><p1>0.03</p1><p2>-0.04</p2>"),
     120.5955, 34.3407},
    {"Metashape", "c.xml", META("frame", "<fx>107</fx><fy>104</fy><cx>1</cx><cy>2</cy><k1>0.1</k1>"), 118.5130,
     36.1243},
    {"Metashape", "c.xml", META("fisheye", "<f>104</f><k1>0.1</k1><k2>0.02</k2><k3>0.01</k3><k4>0.05</k4>"), 114.4556,
     35.5476},
    {"Metashape", "c.xml",
     META("equidistant_fisheye",
          "<f>104</f><k1>0.1</k1><k2>0.02</k2><k3>0.01</k3><k4>0.05</k4><p1>0.03</p1><p2>-0.04</p2>"),
     116.2439, 33.9678},
    {"OpenMVG", "sfm_data.json", MVG("pinhole", ""), 116.8222, 36.5778},
    {"OpenMVG", "sfm_data.json", MVG("pinhole_radial_k1", ",\"disto_k1\":[0.1]"), 117.4613, 36.1243},
    {"OpenMVG", "sfm_data.json", MVG("pinhole_radial_k3", ",\"disto_k3\":[0.1,0.02,0.01]"), 117.4861, 36.1066},
    {"OpenMVG", "sfm_data.json", MVG("pinhole_brown_t2", ",\"disto_t2\":[0.1,0.02,0.01,0.03,-0.04]"), 115.2315,
     37.7366},
    {"OpenMVG", "sfm_data.json", MVG("fisheye", ",\"fisheye\":[0.1,0.02,0.01,0.05]"), 115.4556, 37.5476},
    {"OpenDroneMap or OpenSfM", "reconstruction.json",
     SFM("\"projection_type\":\"perspective\",\"focal\":0.65,\"k1\":0.1,\"k2\":0.02"), 116.4841, 34.1081},
    {"OpenDroneMap or OpenSfM", "reconstruction.json",
     SFM("\"projection_type\":\"brown\",\"focal_x\":0.65,\"focal_y\":0.66,\"c_x\":0.00625,\"c_y\":0.0125,\"k1\":0.1,\"k2\":0.02,\"k3\":0.01,\"p1\":0.03,\"p2\":-0.04"),
     115.2315, 37.3633},
    {"OpenDroneMap or OpenSfM", "reconstruction.json",
     SFM("\"projection_type\":\"fisheye\",\"focal\":0.65,\"k1\":0.1,\"k2\":0.02"), 114.4532, 35.5494},
    {"OpenDroneMap or OpenSfM", "reconstruction.json",
     SFM("\"projection_type\":\"fisheye_opencv\",\"focal_x\":0.65,\"focal_y\":0.66,\"c_x\":0.00625,\"c_y\":0.0125,\"k1\":0.1,\"k2\":0.02,\"k3\":0.01,\"k4\":0.05"),
     115.4556, 37.1714},
    {"Bundler", "bundle.out", "# Bundle file v0.3\n1 0\n104 0.1 0.02\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n", 116.4841, 34.1081},
    {"RealityCapture", "cameras.csv", RC("0.1,0.02,0.01,0.05,0.03,-0.04"), 115.2333, 37.7353},
    {"RealityCapture", "cameras.csv", RC("0.1,0,0,0,0,0"), 117.4851, 36.1073},
    {"RealityCapture XMP", "b.xmp", XMP("brown4t2", "", "0.1 0.02 0.01 0.05 0.03 -0.04"), 115.2333, 37.7353},
    {"RealityCapture XMP", "b.xmp", XMP("division", "", "0.1 0 0 0 0 0"), 117.4851, 36.1073},
    {"RealityCapture XMP", "b.xmp", XMP("perspective", "", "0 0 0 0 0 0"), 116.8222, 36.5778},
};

static void test_projection(void) {
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct lens_row *row = &rows[i];
        struct camera camera;
        struct error err = {.message = ""};
        float x = NAN, y = NAN, depth;
        put(row->source, row->path, row->text);
        bool is_read = source_rig_read(&rig) && rig.t.frame_count == 1;
        CHECK_THAT(is_read, "row %zu, %s: %s", i, row->text, rig.problems);
        if (is_read && frame_camera(&rig.t.frame[0], 160, 120, (double[3]){0}, &camera, &err) == STATUS_OK)
            camera_project(&camera, rigid_point(&camera.world_from_camera, point), &x, &y, &depth);
        CHECK_THAT(fabs((double)x - row->x) < 1e-3 && fabs((double)y - row->y) < 1e-3,
                   "row %zu: seen at %.4f, %.4f, not %.4f, %.4f: %s%s", i, (double)x, (double)y, row->x, row->y,
                   row->text, err.message);
        source_rig_stop(&rig);
    }
}

/* --- what is not modelled --------------------------------------------------------------------- */

static void test_refused(void) {
    static const struct {
        const char *source, *path, *text, *part;
    } refused[] = {
        {"Meshroom", "c.sfm", ALICE_MM("\"type\":\"equidistant\",\"distortionType\":\"radialk3\""), "equidistant"},
        {"Meshroom", "c.sfm", ALICE_MM("\"type\":\"equidistant_r3\""), "equidistant_r3"},
        {"Meshroom", "c.sfm", ALICE_MM("\"type\":\"pinhole\",\"distortionType\":\"3deradial4\""), "3deradial4"},
        {"Meshroom", "c.sfm",
         ALICE_MM("\"type\":\"pinhole\",\"distortionType\":\"none\",\"undistortionType\":\"3deanamorphic4\","
                  "\"undistortionParams\":[\"0.1\"]"),
         "undistortionType 3deanamorphic4"},
        {"Metashape", "c.xml", META("spherical", "<f>104</f>"), "type spherical"},
        {"Metashape", "c.xml", META("equisolid_fisheye", "<f>104</f>"), "type equisolid_fisheye"},
        {"OpenMVG", "sfm_data.json", MVG("pinhole_fisheye1", ",\"fisheye1\":[0.8]"), "no pinhole or fisheye"},
        {"RealityCapture XMP", "b.xmp", XMP("kb4", "", "0.1 0 0 0 0 0"), "model \\\"kb4\\\" is not read"},
        {"RealityCapture XMP", "b.xmp", XMP("division", "", "0.1 0.2 0 0 0 0"), "more than one coefficient"},
        {"RealityCapture XMP", "b.xmp", XMP("brown3", "xcr:Skew=\"0.01\"", "0 0 0 0 0 0"), "xcr:Skew 0.01"},
        {"RealityCapture XMP", "b.xmp", XMP("brown3", "xcr:AspectRatio=\"1.1\"", "0 0 0 0 0 0"), "xcr:AspectRatio 1.1"},
        {"nerfstudio transforms.json", "transforms.json", NERF("\"ftheta_p0\":0,"), "ftheta_p0"},
        {"nerfstudio transforms.json", "transforms.json", NERF("\"equirectangular\":true,"), "equirectangular"},
        {"nerfstudio transforms.json", "transforms.json", NERF("\"orthographic\":true,"), "orthographic"},
        {"OpenDroneMap or OpenSfM", "reconstruction.json", SFM("\"projection_type\":\"fisheye624\",\"focal\":0.6"),
         "type fisheye624"},
    };
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        put(refused[i].source, refused[i].path, refused[i].text);
        source_rig_refused(&rig, refused[i].part);
        source_rig_stop(&rig);
    }
    put("nerfstudio transforms.json", "transforms.json", NERF("\"latlong\":false,"));
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1);
    source_rig_stop(&rig);
}

static void test_told(void) {
    static const struct {
        const char *source, *path, *text, *part; /* part NULL: nothing is told of */
    } told[] = {
        {"Metashape", "c.xml", META("frame", "<f>104</f><b2>2</b2>"), "photographs' corners by 1.2 pixels"},
        {"Metashape", "c.xml", META("frame", "<f>104</f><p1>0.03</p1><p2>-0.04</p2><p3>0.1</p3>"),
         "corners by 1.3 pixels"},
        {"Metashape", "c.xml", META("frame", "<f>104</f><b2>0.2</b2>"), NULL},
        {"RealityCapture", "c.csv", RC("0.1,0,0,0,0,0"), "1 lenses have k1 alone"},
        {"RealityCapture", "c.csv", RC("0.1,0.01,0,0,0,0"), NULL},
    };
    for (size_t i = 0; i < sizeof told / sizeof *told; i++) {
        put(told[i].source, told[i].path, told[i].text);
        CHECK(source_rig_read(&rig) && rig.t.frame_count == 1);
        bool is_told = told[i].part ? source_rig_warned(&rig, told[i].part) : rig.findings.warning_count == 0;
        CHECK_THAT(is_told, "row %zu: %s", i, rig.findings.warning_count > 0 ? rig.findings.warning[0] : "nothing");
        source_rig_stop(&rig);
    }
}

int main(void) {
    test_projection();
    test_refused();
    test_told();
    return check_result();
}
