/* test_source_readers.c -- readers of photogrammetry's programs: source_view.h. */
#include "server/ingest/source/values.h"
#include "tests/unit/source_view.h"

#define BUNDLER_R                                                                                                      \
    "0.37578195333480835 0 -0.9267081618309021 -0.030915768817067146 0.99944329261779785 -0.012536403723061085 0.92619222402572632 0.033360846340656281 0.37557274103164673"
#define BUNDLER_T "1.3418485329401335 -1.5977123720756299 -5.2088782849022852"
#define W2C_JSON                                                                                                       \
    "[0.37578195333480835, 0, -0.9267081618309021], [0.030915768817067146, -0.99944329261779785, 0.012536403723061085], [-0.92619222402572632, -0.033360846340656281, -0.37557274103164673]"
#define CENTRE_JSON "4.2707862854003906, 1.7705957889556885, 3.1797852516174316"
#define ALICE_R                                                                                                        \
    "\"0.37578195333480835\", \"0.030915768817067146\", \"-0.92619222402572632\", \"-0\", \"0.99944329261779785\", \"0.033360846340656281\", \"0.9267081618309021\", \"-0.012536403723061085\", \"0.37557274103164673\""
#define ALICE_C "\"4.2707862854003906\", \"-1.7705957889556885\", \"-3.1797852516174316\""
#define ALICE_OLD_R                                                                                                    \
    "\"0.37578195333480835\", \"0.030915768817067146\", \"-0.92619222402572632\", \"0\", \"-0.99944329261779785\", \"-0.033360846340656281\", \"-0.9267081618309021\", \"0.012536403723061085\", \"-0.37557274103164673\""
#define ALICE_OLD_C "\"4.2707862854003906\", \"1.7705957889556885\", \"3.1797852516174316\""
#define AXIS_ANGLE_JSON "2.6284499300474553, 0.029540719009203131, -1.7704883865096552"
#define T_JSON "1.3418485329401335, 1.5977123720756299, 5.2088782849022852"
#define W2C                                                                                                            \
    "0.37578195333480835 0 -0.9267081618309021 0.030915768817067146 -0.99944329261779785 0.012536403723061085 -0.92619222402572632 -0.033360846340656281 -0.37557274103164673"
#define CENTRE "4.2707862854003906 1.7705957889556885 3.1797852516174316"
#define RC_POSE                                                                                                        \
    "4.2707862854003906,1.7705957889556885,3.1797852516174316,-1.7717647825109362,-0.71830183933067648,67.938459824547948"
#define META_CAMERA                                                                                                    \
    "0 -0.99944329261779785 -0.033360846340656281 -0.11470210552215576 -0.37578195333480835 -0.030915768817067146 0.92619222402572632 -1.6353931427001953 -0.9267081618309021 0.012536403723061085 -0.37557274103164673 0.08989262580871582 0 0 0 1"

/* --- photogrammetry --------------------------------------------------------------------------- */

static void test_bundler(void) {
    source_rig_start(&rig, "Bundler");
    put("bundle.out", "# Bundle file v0.3\n3 1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n1e2 -0.1 0.02\n" BUNDLER_R
                      "\n" BUNDLER_T "\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n1 2 3\n255 0 0\n0\n");
    put("list.txt", "./x.jpg\n./images/b.jpg 0 541.2\n./y.jpg\n");
    put("images/b.jpg", "");
    const struct frame *frame = check(0, 1, "images/b.jpg");
    CHECK(isnan(frame->lens.cx) && frame->lens.fl_x == 100.0 && frame->lens.k[0] == -0.1 && frame->lens.k[1] == 0.02);
    CHECK(source_rig_warned(&rig, "2 photographs have no pose"));
    put("list.txt", "./x y.jpg\n./images/b c.JPG 0 541.2\n./y.jpg\n");
    put("images/b c.jpg", "");
    check(0, 1, "images/b c.jpg");
    put("list.txt", "./x.jpg\n");
    source_rig_refused(&rig, "names only 1 photographs");
    put("bundle.out", "# Bundle file v0.3\n1 0\n100 0 0\n1 0 0\n");
    source_rig_refused(&rig, "camera 0 has not its 15 numbers");
    source_rig_drop(&rig, "list.txt");
    source_rig_refused(&rig, "list.txt");
    source_rig_stop(&rig);
}

#define MVG(distortion)                                                                                                \
    "{\"root_path\":\"/home/me/scan/images\",\"views\":["                                                              \
    "{\"key\":0,\"value\":{\"ptr_wrapper\":{\"data\":{\"local_path\":\"\",\"filename\":\"b.jpg\",\"id_intrinsic\":7,"  \
    "\"id_pose\":3}}}},"                                                                                               \
    "{\"key\":1,\"value\":{\"ptr_wrapper\":{\"data\":{\"filename\":\"c.jpg\",\"id_intrinsic\":7,\"id_pose\":4}}}}],"   \
    "\"intrinsics\":[{\"key\":7,\"value\":{\"polymorphic_name\":\"x\",\"ptr_wrapper\":{\"data\":{" distortion "}}}}]," \
    "\"extrinsics\":[{\"key\":3,\"value\":{\"rotation\":[" W2C_JSON "],\"center\":[" CENTRE_JSON "]}}]}"

static void test_openmvg(void) {
    source_rig_start(&rig, "OpenMVG");
    put("images/b.jpg", "");
    put("sfm_data.json",
        MVG("\"value0\":{\"width\":160,\"height\":120,\"focal_length\":104,\"principal_point\":[81,61]},"
            "\"disto_t2\":[0.1,0.2,0.3,0.01,0.02]"));
    const struct frame *frame = check(0, 1, "images/b.jpg");
    check_lens(&frame->lens, 104, 81, 61, 0.1, 0.01, 0.02);
    CHECK(frame->lens.width == 160.0 && source_rig_warned(&rig, "1 photographs have no pose"));
    put("sfm_data.json", MVG("\"width\":160,\"height\":120,\"focal_length\":104,\"principal_point\":[81,61],"
                             "\"disto_k3\":[0.1,0.2,0.3]"));
    check_lens(&check(0, 1, "images/b.jpg")->lens, 104, 81, 61, 0.1, 0, 0);
    put("sfm_data.json", MVG("\"width\":160,\"height\":120,\"focal_length\":104,\"principal_point\":[81,61],"
                             "\"fisheye\":[0.1,0.2,0.3,0.4]"));
    CHECK(check(0, 1, "images/b.jpg")->lens.model == CAMERA_OPENCV_FISHEYE);
    put("sfm_data.json", MVG("\"width\":160,\"height\":120"));
    source_rig_refused(&rig, "no pinhole or fisheye");
    source_rig_stop(&rig);
}

#define ALICE(version, lens, r, c)                                                                                     \
    "{\"version\":[" version "],\"views\":[{\"viewId\":\"1\",\"poseId\":\"1\",\"intrinsicId\":\"9\",\"path\":"         \
    "\"D:/scan/in/b.jpg\"},{\"viewId\":\"2\",\"poseId\":\"2\",\"intrinsicId\":\"9\",\"path\":\"D:/scan/in/c.jpg\"}],"  \
    "\"intrinsics\":[{\"intrinsicId\":\"9\",\"width\":\"160\",\"height\":\"120\"," lens                                \
    "}],\"poses\":[{\"poseId\":\"1\","                                                                                 \
    "\"pose\":{\"transform\":{\"rotation\":[" r "],\"center\":[" c "]},\"locked\":\"0\"}}]}"
#define ALICE_LENS                                                                                                            \
    "\"sensorWidth\":\"36\",\"sensorHeight\":\"27\",\"focalLength\":\"23.4\",\"pixelRatio\":\"1\",\"principalPoint\":[\"1\"," \
    "\"2\"],\"type\":\"pinhole\","

static void test_alicevision(void) {
    source_rig_start(&rig, "Meshroom");
    put("images/b.JPG", "");
    put("cameras.sfm", ALICE("\"1\",\"2\",\"6\"",
                             ALICE_LENS "\"distortionType\":\"radialk3\",\"distortionParams\":[\"0.1\",\"0\",\"0\"]",
                             ALICE_R, ALICE_C));
    check_lens(&check(0, 1, "images/b.JPG")->lens, 104, 81, 62, 0.1, 0, 0);
    CHECK(source_rig_warned(&rig, "1 photographs have no pose"));
    put("cameras.sfm", ALICE("\"1\",\"0\",\"0\"",
                             "\"pxFocalLength\":\"104\",\"principalPoint\":[\"81\",\"62\"],\"type\":\"radial3\","
                             "\"distortionParams\":[\"0.1\",\"0\",\"0\"]",
                             ALICE_OLD_R, ALICE_OLD_C));
    check_lens(&check(0, 1, "images/b.JPG")->lens, 104, 81, 62, 0.1, 0, 0);
    put("cameras.sfm",
        ALICE("\"1\",\"2\",\"6\"", ALICE_LENS "\"distortionType\":\"3deanamorphic4\",\"distortionParams\":[\"1\"]",
              ALICE_R, ALICE_C));
    source_rig_refused(&rig, "3deanamorphic4 are not read");
    source_rig_stop(&rig);
}

/* Rotations stored column by column, of the world into the rig and of the rig into the camera: by 90 degrees around z
 * and around x. */
#define RIG(independent, status)                                                                                       \
    "{\"version\":[1,2,0],\"views\":[{\"poseId\":\"1\",\"intrinsicId\":\"9\",\"rigId\":\"7\",\"subPoseId\":\"1\","     \
    "\"isPoseIndependant\":\"" independent                                                                             \
    "\",\"path\":\"b.jpg\"}],\"intrinsics\":[{\"intrinsicId\":\"9\",\"width\":160,\"height\":120,"                     \
    "\"pxFocalLength\":[104,104],\"principalPoint\":[80,60],\"type\":\"pinhole\"}],"                                   \
    "\"poses\":[{\"poseId\":\"1\",\"pose\":{\"transform\":{\"rotation\":[0,-1,0,1,0,0,0,0,1],\"center\":[1,2,3]}}}],"  \
    "\"rigs\":[{\"rigId\":\"7\",\"subPoses\":[{\"status\":\"constant\"},{\"status\":\"" status                         \
    "\",\"pose\":{\"rotation\":[1,0,0,0,0,-1,0,1,0],\"center\":[0.1,0.2,0.3]}}]}]}"

/* A camera of a rig stands where the rig and its place in it put it. */
static void test_alicevision_rig(void) {
    source_rig_start(&rig, "Meshroom");
    put("b.jpg", "");
    put("cameras.sfm", RIG("false", "estimated"));
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1);
    const struct exact_pose *pose = &rig.t.frame[0].world_from_camera;
    CHECK_NEAR(pose->translation[0], 1 - 0.2, 1e-12);
    CHECK_NEAR(pose->translation[1], 2 + 0.1, 1e-12);
    CHECK_NEAR(pose->translation[2], 3 + 0.3, 1e-12);
    CHECK_NEAR(pose->rotation[0][2], 1, 1e-12); /* the camera's z is the rig's -y, the world's x */
    CHECK_NEAR(pose->rotation[1][0], 1, 1e-12);
    put("cameras.sfm", RIG("true", "estimated"));
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1 && rig.t.frame[0].world_from_camera.translation[0] == 1.0);
    put("cameras.sfm", RIG("false", "uninitialized"));
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 0 && source_rig_warned(&rig, "1 photographs have no pose"));
    source_rig_stop(&rig);
}

#define SFM(lens)                                                                                                      \
    "[{\"cameras\":{\"v2\":{\"width\":160,\"height\":120," lens                                                        \
    "}},\"shots\":{\"b.jpg\":{\"camera\":\"v2\",\"rotation\":[" AXIS_ANGLE_JSON "],\"translation\":[" T_JSON           \
    "]}}},{\"cameras\":{},\"shots\":{}}]"

static void test_opensfm(void) {
    source_rig_start(&rig, "OpenDroneMap or OpenSfM");
    put("images/b.jpg", "");
    put("images/c.jpg", "");
    put("opensfm/reconstruction.json", SFM("\"projection_type\":\"perspective\",\"focal\":0.65,\"k1\":0.1,\"k2\":0"));
    check_lens(&check(0, 1, "images/b.jpg")->lens, 104, 80, 60, 0.1, 0, 0);
    CHECK(source_rig_warned(&rig, "1 photographs in images/ have no pose"));
    put("odm_georeferencing/coords.txt", "WGS84 UTM 32N\n600000 5000000\n");
    CHECK(source_rig_read(&rig) && source_rig_warned(&rig, "may be in other coordinates"));
    put("opensfm/reconstruction.topocentric.json", "[]"); /* since version 2.0: the other one is georeferenced */
    CHECK(source_rig_read(&rig) && !source_rig_warned(&rig, "may be in other coordinates"));
    put("opensfm/reconstruction.geocoords.json",
        SFM("\"projection_type\":\"brown\",\"focal_x\":0.65,\"focal_y\":0.66,\"c_x\":0.0125,\"c_y\":-0.0125,\"k1\":0.1,"
            "\"p1\":0.01,\"p2\":0.02"));
    check_lens(&check(0, 1, "images/b.jpg")->lens, 104, 82, 58, 0.1, 0.01, 0.02);
    put("opensfm/reconstruction.geocoords.json", SFM("\"projection_type\":\"spherical\""));
    source_rig_refused(&rig, "type spherical are not read");
    source_rig_stop(&rig);
}

#define RC_HEADER "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n"

static void test_realitycapture(void) {
    source_rig_start(&rig, "RealityCapture");
    put("images/b.jpg", "");
    put("images/c.jpg", "");
    put("export.csv", "#cameras 1\n" RC_HEADER "b.jpg," RC_POSE ",23.4,0.225,0.45,0.1,0,0,0,0.01,0.02\n");
    const struct frame *frame = check(0, 1, "images/b.jpg");
    struct camera camera;
    struct error err = {.message = ""};
    CHECK(frame_camera(frame, 160, 120, (double[3]){0}, &camera, &err) == STATUS_OK);
    CHECK_NEAR(camera.fx, 104, 1e-4);
    CHECK_NEAR(camera.cx, 81, 1e-4);
    CHECK_NEAR(camera.cy, 62, 1e-4);
    CHECK_NEAR(camera.p[1], 0.02, 1e-7);
    CHECK(source_rig_warned(&rig, "1 photographs in images/ have no pose"));
    CHECK(frame_camera(frame, 120, 160, (double[3]){0}, &camera, &err) == STATUS_OK && fabsf(camera.cx - 61) < 1e-4f);
    put("export.csv", RC_HEADER "b.jpg,1,2,3,0,0,x,23.4,0,0,0,0,0,0,0,0\n");
    source_rig_refused(&rig, "line 2: column 7 is no number");
    put("export.csv", "#name,x,y,alt,heading\nb.jpg,1,2,3,4\n");
    source_rig_refused(&rig, "has no column pitch");
    source_rig_stop(&rig);
}

#define XMP(attributes, inner)                                                                                         \
    "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"   \
    "  <rdf:Description xcr:Version=\"3\" xcr:Coordinates=\"absolute\" " attributes                                    \
    " xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\">\n" inner "</rdf:Description></rdf:RDF></x:xmpmeta>\n"
#define XMP_POSE                                                                                                       \
    "<xcr:Rotation>" W2C "</xcr:Rotation>\n<xcr:Position>" CENTRE "</xcr:Position>"                                    \
    "<xcr:DistortionCoeficients>0.1 0 0 0 0.01 0.02</xcr:DistortionCoeficients>"

static void test_realitycapture_xmp(void) {
    source_rig_start(&rig, "RealityCapture XMP");
    put("b.jpg", "");
    put("b.xmp", XMP("xcr:DistortionModel=\"brown3t2\" xcr:FocalLength35mm=\"23.4\" xcr:PrincipalPointU=\"0.00625\" "
                     "xcr:PrincipalPointV=\"0.0125\"",
                     XMP_POSE));
    put("c.xmp", XMP("", ""));
    const struct frame *frame = check(0, 1, "b.jpg");
    struct camera camera;
    struct error err = {.message = ""};
    CHECK(frame_camera(frame, 160, 120, (double[3]){0}, &camera, &err) == STATUS_OK);
    CHECK_NEAR(camera.fx, 104, 1e-4);
    CHECK_NEAR(camera.cx, 81, 1e-4);
    CHECK_NEAR(camera.cy, 62, 1e-4);
    CHECK(source_rig_warned(&rig, "1 files .xmp hold no pose"));
    put("b.xmp", XMP("xcr:DistortionModel=\"division\" xcr:FocalLength35mm=\"23.4\"", XMP_POSE));
    frame = check(0, 1, "b.jpg");
    CHECK(frame_camera(frame, 160, 120, (double[3]){0}, &camera, &err) == STATUS_OK);
    CHECK(camera.model == CAMERA_DIVISION && camera.k[0] == 0.1f);
    put("b.xmp", XMP("xcr:DistortionModel=\"division2\" xcr:FocalLength35mm=\"23.4\"",
                     "<xcr:Rotation>" W2C "</xcr:Rotation>\n<xcr:Position>" CENTRE "</xcr:Position>"
                     "<xcr:DistortionCoeficients>0.1 0.2 0 0 0 0</xcr:DistortionCoeficients>"));
    source_rig_refused(&rig, "division2");
    put("b.xmp", "<a><b></a>");
    source_rig_refused(&rig, "b.xmp");
    source_rig_stop(&rig);
}

#define META(inner)                                                                                                                  \
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\">\n<chunk label=\"Chunk 1\" enabled=\"true\">\n"         \
    "<sensors next_id=\"1\"><sensor id=\"0\" label=\"unknown\" type=\"frame\"><resolution width=\"160\" height=\"120\"/>"            \
    "<calibration type=\"frame\" class=\"initial\"><f>1</f></calibration>"                                                           \
    "<calibration type=\"frame\" class=\"adjusted\"><resolution width=\"160\" height=\"120\"/><f>104</f><cx>1</cx>"                  \
    "<cy>2</cy><k1>0.1</k1><p1>0.02</p1><p2>0.01</p2></calibration></sensor></sensors>" inner                                        \
    "<cameras next_id=\"2\"><group id=\"0\"><camera id=\"0\" sensor_id=\"0\" component_id=\"0\" label=\"b\"><transform>" META_CAMERA \
    "</transform></camera></group><camera id=\"1\" sensor_id=\"0\" label=\"c\"/></cameras></chunk></document>"
#define META_TRANSFORM                                                                                                 \
    "<transform><rotation locked=\"true\">0 -1 0 1 0 0 0 0 1</rotation><translation>1 2 3</translation>"               \
    "<scale>2</scale></transform>"

/* Where the camera stands in each of the coordinates that a model may have. */
static void test_geocentric(struct frames *t) {
    double m[16], camera[3]; /* in the chunk's */
    CHECK(numbers_parse(META_CAMERA, 16, m));
    for (int i = 0; i < 3; i++)
        camera[i] = m[4 * i + 3];
    const double *at = t->frame[0].world_from_camera.translation;
    double scale = 12.354192447331316, distance = 0.0, origin[3] = {-2499366.429888, -4256836.520906, 4029217.965003};
    struct mesh mesh = {0};
    CHECK(t->other_count == 3 && t->is_placed_by_mesh);
    for (int i = 0; i < 3; i++)
        distance += (at[i] - origin[i]) * (at[i] - origin[i]);
    CHECK_NEAR(sqrt(distance), scale * sqrt(camera[0] * camera[0] + camera[1] * camera[1] + camera[2] * camera[2]),
               1e-3);
    double height = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
    CHECK(frames_choose_coordinates(t, "local", NULL, NULL) == STATUS_OK);
    double across = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
    CHECK_NEAR(across, sqrt(distance), 1e-6);
    /* Up is away from the Earth's centre, but for a fifth of a degree. */
    double middle = sqrt(origin[0] * origin[0] + origin[1] * origin[1] + origin[2] * origin[2]);
    CHECK_NEAR(at[2], height - middle, 0.0034 * across + 1e-3);
    CHECK(frames_choose_coordinates(t, "chunk", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(at[i], camera[i], 1e-6);
    /* By a mesh about the cameras in one of them. */
    CHECK(frames_choose_coordinates(t, "file", NULL, NULL) == STATUS_OK);
    vec3 corner[2] = {{-8.0f, -8.0f, -8.0f}, {8.0f, 8.0f, 8.0f}};
    uint32_t index[1][3] = {{0, 1, 0}};
    mesh.position = corner;
    mesh.vertex_count = 2;
    mesh.index = index;
    mesh.triangle_count = 1;
    CHECK(frames_choose_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "chunk");
    memcpy(mesh.offset, origin, sizeof origin);
    CHECK(frames_choose_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "file");
    CHECK(!t->stands_apart);
    CHECK(frames_choose_coordinates(t, "projected", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        mesh.offset[i] = round(at[i]);
    CHECK(mesh.offset[0] > 2e5 && mesh.offset[0] < 8e5 && mesh.offset[1] > 4.3e6 && mesh.offset[1] < 4.5e6);
    CHECK(frames_choose_coordinates(t, "file", NULL, NULL) == STATUS_OK);
    CHECK(frames_choose_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "projected");
    mesh.offset[0] += 1e5; /* another system, say */
    CHECK(frames_choose_coordinates(t, NULL, &mesh, NULL) == STATUS_OK && t->stands_apart);
}

static void test_metashape(void) {
    source_rig_start(&rig, "Metashape");
    put("photos/b.jpg", "");
    put("other.xml", "<other/>");
    put("room cameras.xml", META(META_TRANSFORM));
    check_lens(&check(0, 1, "photos/b.jpg")->lens, 104, 81, 62, 0.1, 0.01, 0.02);
    CHECK(source_rig_warned(&rig, "1 photographs have no pose"));
    put("room cameras.xml",
        META("<components><component id=\"0\" label=\"Component 1\">" META_TRANSFORM "</component></components>"));
    check(0, 1, "photos/b.jpg");
    /* of a real export, in geocentric coordinates */
    put("room cameras.xml",
        META(
            "<transform><rotation locked=\"true\">0.8710699454 0.3070967021 -0.3833128821 -0.4909742007 0.5658364395 "
            "-0.6623997719 0.0134716110 0.7651932691 0.6436596744</rotation><translation locked=\"true\">-2499366.429888 "
            "-4256836.520906 4029217.965003</translation><scale locked=\"true\">12.354192447331316</scale></transform>"));
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1 && rig.findings.problem_count == 0);
    test_geocentric(&rig.t);
    source_rig_stop(&rig);
}

int main(void) {
    test_bundler();
    test_openmvg();
    test_alicevision();
    test_alicevision_rig();
    test_opensfm();
    test_realitycapture();
    test_realitycapture_xmp();
    test_metashape();
    return check_result();
}
