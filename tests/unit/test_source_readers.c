/* test_source_readers.c -- readers of sources without a capture in the test data: one view of the demo room, written as each
 * tool has it, is read as the pose that transforms.json of the room has. The texts were computed from that pose by the
 * formulas that the tools document (named in the readers), apart from this program. */
#include "server/ingest/source/values.h"
#include "tests/unit/source_rig.h"

#define RECORD3D_POSE                                                                                                  \
    "-0.013836534202164496, 0.55858944765791385, 0.0093201028826282138, 0.82927648992725178, 4.2707862854003906, 1.7705957889556885, 3.1797852516174316"
#define SCANNER_POSE                                                                                                   \
    "0.37578195333480835, -0.030915768817067146, 0.92619222402572632, 4.2707862854003906, 0, 0.99944329261779785, 0.033360846340656281, 1.7705957889556885, -0.9267081618309021, -0.012536403723061085, 0.37557274103164673, 3.1797852516174316, 0, 0, 0, 1"
#define CV_MATRIX                                                                                                      \
    "0.37578195333480835 0.030915768817067146 -0.92619222402572632 4.2707862854003906 0 -0.99944329261779785 -0.033360846340656281 1.7705957889556885 -0.9267081618309021 0.012536403723061085 -0.37557274103164673 3.1797852516174316 0 0 0 1"
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
#define ARKIT_LINE                                                                                                     \
    "2.6284499300474553 0.029540719009203131 -1.7704883865096552 1.3418485329401335 1.5977123720756299 5.2088782849022852"
#define TUM_LINE                                                                                                       \
    "4.2707862854003906 1.7705957889556885 3.1797852516174316 0.82927648992725178 0.0093201028826282138 -0.55858944765791385 0.013836534202164496"
#define W2C                                                                                                            \
    "0.37578195333480835 0 -0.9267081618309021 0.030915768817067146 -0.99944329261779785 0.012536403723061085 -0.92619222402572632 -0.033360846340656281 -0.37557274103164673"
#define CENTRE "4.2707862854003906 1.7705957889556885 3.1797852516174316"
#define RC_POSE                                                                                                        \
    "4.2707862854003906,1.7705957889556885,3.1797852516174316,-1.7717647825109362,-0.71830183933067648,67.938459824547948"
#define META_CAMERA                                                                                                    \
    "0 -0.99944329261779785 -0.033360846340656281 -0.11470210552215576 -0.37578195333480835 -0.030915768817067146 0.92619222402572632 -1.6353931427001953 -0.9267081618309021 0.012536403723061085 -0.37557274103164673 0.08989262580871582 0 0 0 1"

/* The pose in question with our camera axes: the columns of transforms.json's y and z turned around. */
static const double wanted[3][4] = {
    {0.37578195333480835, 0.030915768817067146, -0.9261922240257263, 4.270786285400391},
    {0.0, -0.9994432926177979, -0.03336084634065628, 1.7705957889556885},
    {-0.9267081618309021, 0.012536403723061085, -0.37557274103164673, 3.1797852516174316}};

static struct source_rig rig;

static void put(const char *name, const char *text) { source_rig_put(&rig, name, text); }

/* Reads what was put and checks frame `number`: its pose, its photograph, and that so many frames are there. */
static const struct frame *check(size_t number, size_t count, const char *photograph) {
    CHECK(source_rig_read(&rig));
    CHECK_STRING(rig.problems, "[]");
    CHECK_THAT(rig.t.frame_count == count, "%s: %zu frames", rig.name, rig.t.frame_count);
    if (rig.t.frame_count <= number)
        exit(1);
    const struct frame *frame = &rig.t.frame[number];
    CHECK_STRING(frame->file, photograph);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            CHECK_NEAR(frame->world_from_camera.rotation[i][j], wanted[i][j], 1e-7);
        CHECK_NEAR(frame->world_from_camera.translation[i], wanted[i][3], 2e-6);
    }
    return frame;
}

static void check_lens(const struct lens *lens, double fx, double cx, double cy, double k1, double p1, double p2) {
    CHECK_NEAR(lens->fl_x, fx, 1e-9);
    CHECK_NEAR(lens->cx, cx, 1e-9);
    CHECK_NEAR(lens->cy, cy, 1e-9);
    CHECK_NEAR(lens->k[0], k1, 1e-12);
    CHECK_NEAR(lens->p[0], p1, 1e-12);
    CHECK_NEAR(lens->p[1], p2, 1e-12);
}

/* --- phones ----------------------------------------------------------------------------------- */

static void test_record3d(void) {
    source_rig_start(&rig, "Record3D");
    put("metadata",
        "{\"w\":160,\"h\":120,\"K\":[104,0,0, 0,105,0, 81,61,1],\"perFrameIntrinsicCoeffs\":[[104,105,81,61],"
        "[110,111,82,62]],\"poses\":[[0,0,0,1,0,0,0],[" RECORD3D_POSE "]]}");
    put("rgbd/0.jpg", "");
    put("rgbd/1.jpg", "");
    put("rgbd/1.depth", "");
    check_lens(&check(1, 2, "rgbd/1.jpg")->lens, 110, 82, 62, 0, 0, 0);
    put("metadata", "{\"w\":160,\"h\":120,\"K\":[1],\"poses\":[]}");
    source_rig_refused(&rig, "K");
    put("metadata", "{\"w\":160,\"h\":120,\"K\":[104,0,0, 0,105,0, 81,61,1],\"poses\":[[1,2]]}");
    source_rig_refused(&rig, "poses[0] must be 7 numbers");
    source_rig_stop(&rig);
}

static void test_scanner3d(void) {
    source_rig_start(&rig, "3D Scanner App");
    put("info.json", "{}");
    put("frame_00000.json", "{\"cameraPoseARFrame\":[" SCANNER_POSE "],\"intrinsics\":[104,0,81,0,105,61,0,0,1]}");
    put("frame_00000.jpg", "");
    put("frame_00001.json", "no photograph, which is of every tenth frame only");
    check_lens(&check(0, 1, "frame_00000.jpg")->lens, 104, 81, 61, 0, 0, 0);
    put("frame_00000.json", "{\"intrinsics\":[104,0,81,0,105,61,0,0,1]}");
    source_rig_refused(&rig, "cameraPoseARFrame");
    source_rig_stop(&rig);
}

static void test_polycam_alignment(void) {
    source_rig_start(&rig, "Polycam raw data");
    /* the mesh is turned by 90 degrees around y, (x, y, z) to (z, y, -x), and moved: columns one after the other */
    put("mesh_info.json", "{\"alignmentTransform\":[0,0,-1,0, 0,1,0,0, 1,0,0,0, 1,2,3,1]}");
    put("keyframes/cameras/7.json",
        "{\"t_00\":1,\"t_01\":0,\"t_02\":0,\"t_03\":5,\"t_10\":0,\"t_11\":1,\"t_12\":0,\"t_13\":6,\"t_20\":0,\"t_21\":0,"
        "\"t_22\":1,\"t_23\":7,\"fx\":104,\"fy\":104,\"cx\":80,\"cy\":60,\"width\":160,\"height\":120}");
    put("keyframes/images/7.jpg", "");
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1);
    const struct exact_pose *pose = &rig.t.frame[0].world_from_camera;
    CHECK_NEAR(pose->translation[0], 7 + 1, 1e-12);
    CHECK_NEAR(pose->translation[1], 6 + 2, 1e-12);
    CHECK_NEAR(pose->translation[2], -5 + 3, 1e-12);
    CHECK_NEAR(pose->rotation[2][0], -1, 1e-12); /* the camera's x */
    put("keyframes/cameras/7.json", "{\"t_00\":1}");
    source_rig_refused(&rig, "keyframes/cameras/7.json");
    source_rig_stop(&rig);
}

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

/* Rotations stored column by column, of the world into the rig and of the rig into the camera: by 90 degrees around z and
 * around x. */
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
    CHECK(frames_settle_coordinates(t, "local", NULL, NULL) == STATUS_OK);
    double across = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
    CHECK_NEAR(across, sqrt(distance), 1e-6);
    /* Up is away from the Earth's centre, but for a fifth of a degree. */
    double middle = sqrt(origin[0] * origin[0] + origin[1] * origin[1] + origin[2] * origin[2]);
    CHECK_NEAR(at[2], height - middle, 0.0034 * across + 1e-3);
    CHECK(frames_settle_coordinates(t, "chunk", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(at[i], camera[i], 1e-6);
    /* By a mesh about the cameras in one of them. */
    CHECK(frames_settle_coordinates(t, "file", NULL, NULL) == STATUS_OK);
    vec3 corner[2] = {{-8.0f, -8.0f, -8.0f}, {8.0f, 8.0f, 8.0f}};
    uint32_t index[1][3] = {{0, 1, 0}};
    mesh.position = corner;
    mesh.vertex_count = 2;
    mesh.index = index;
    mesh.triangle_count = 1;
    CHECK(frames_settle_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "chunk");
    memcpy(mesh.offset, origin, sizeof origin);
    CHECK(frames_settle_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "file");
    CHECK(!t->stands_apart);
    CHECK(frames_settle_coordinates(t, "projected", NULL, NULL) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        mesh.offset[i] = round(at[i]);
    CHECK(mesh.offset[0] > 2e5 && mesh.offset[0] < 8e5 && mesh.offset[1] > 4.3e6 && mesh.offset[1] < 4.5e6);
    CHECK(frames_settle_coordinates(t, "file", NULL, NULL) == STATUS_OK);
    CHECK(frames_settle_coordinates(t, NULL, &mesh, NULL) == STATUS_OK);
    CHECK_STRING(t->coordinates, "projected");
    mesh.offset[0] += 1e5; /* another system, say */
    CHECK(frames_settle_coordinates(t, NULL, &mesh, NULL) == STATUS_OK && t->stands_apart);
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

/* --- data sets -------------------------------------------------------------------------------- */

static void test_arkitscenes(void) {
    source_rig_start(&rig, "ARKitScenes");
    put("lowres_wide.traj", "10.0 0 0 0 1 2 3\n10.5 " ARKIT_LINE "\n10.6 " ARKIT_LINE "\n");
    put("lowres_wide/40753679_10.550.png", "");
    put("lowres_wide/40753679_99.0.png", "");
    put("lowres_wide_intrinsics/40753679_10.200.pincam", "256 192 200 200 128 96\n");
    put("lowres_wide_intrinsics/40753679_10.551.pincam", "256 192 212 213 127 95\n"); /* rounded differently */
    put("lowres_wide_intrinsics/40753679_10.900.pincam", "256 192 200 200 128 96\n");
    check_lens(&check(0, 1, "lowres_wide/40753679_10.550.png")->lens, 212, 127, 95, 0, 0, 0);
    CHECK(source_rig_warned(&rig, "1 photographs have no pose at their time"));
    put("wide/40753679_10.560.png", "");
    put("wide_intrinsics/40753679_10.560.pincam", "1920 1440 1600 1600 954 714\n");
    check_lens(&check(0, 1, "wide/40753679_10.560.png")->lens, 1600, 954, 714, 0, 0, 0);
    put("lowres_wide.traj", "10.0 0 0 0 1 2\n");
    source_rig_refused(&rig, "line 1");
    source_rig_stop(&rig);
}

static void test_tum(void) {
    const struct frames *t = &rig.t;
    source_rig_start(&rig, "TUM RGB-D");
    put("rgb.txt",
        "# color images\n# file: 'rgbd_dataset_freiburg2_desk.bag'\n# timestamp filename\n1.00 rgb/1.00.png\n"
        "1.05 rgb/1.05.png\n7 rgb/7.png\n");
    put("groundtruth.txt", "# ground truth\n1.09 3 1 1 0 0 0 1\n1.00 " TUM_LINE "\n1.01 1 1 1 0 0 0 1\n");
    put("rgb/1.00.png", "");
    put("rgb/1.05.png", "");
    put("rgb/7.png", "");
    check_lens(&check(0, 2, "rgb/1.00.png")->lens, 520.9, 325.6, 250.2, 0.2312, -0.0033, -0.0001);
    CHECK_NEAR(t->frame[1].world_from_camera.translation[0], 2.0, 1e-9); /* half way */
    CHECK(source_rig_warned(&rig, "1 photographs have no pose at their time"));
    /* as Windows' editors save it, and PowerShell */
    source_rig_put_bytes(&rig, "calibration.txt",
                         "\xff\xfe"
                         "5\0000\0000\0 \0005\0000\0001\0 \0003\0002\0000\0 \0002\0004\0000\0",
                         32);
    CHECK(source_rig_read(&rig) && t->frame_count == 2 && t->frame[0].lens.fl_y == 501.0);
    put("groundtruth.txt", "\xef\xbb\xbf# ground truth\n1.09 3 1 1 0 0 0 1\n1.00 " TUM_LINE "\n1.01 1 1 1 0 0 0 1\n");
    put("calibration.txt", "\xef\xbb\xbf"
                           "500 501 320 240");
    CHECK(source_rig_read(&rig) && t->frame_count == 2 && t->frame[0].lens.fl_y == 501.0 &&
          t->frame[0].lens.cx == 320.5);
    put("calibration.txt", "500");
    source_rig_refused(&rig, "expected fx fy cx cy");
    source_rig_stop(&rig);
}

static void test_sevenscenes(void) {
    source_rig_start(&rig, "7-Scenes");
    put("seq-01/frame-000003.pose.txt", CV_MATRIX);
    put("seq-01/frame-000003.color.png", "");
    put("seq-01/frame-000003.depth.png", "");
    put("seq-02/frame-000000.pose.txt", "nan nan nan nan nan nan nan nan nan nan nan nan 0 0 0 1");
    CHECK(check(0, 1, "seq-01/frame-000003.color.png")->lens.fl_x == 525.0);
    CHECK(source_rig_warned(&rig, "1 poses are not finite"));
    source_rig_stop(&rig);
}

#define NERF(model, file)                                                                                              \
    "{\"camera_model\":\"" model                                                                                       \
    "\",\"w\":160,\"h\":120,\"fl_x\":104,\"fl_y\":104,\"cx\":80,\"cy\":60,\"k1\":0.1,\"frames\":["                     \
    "{\"file_path\":\"" file "\",\"mask_path\":\"DSC1.png\",\"is_bad\":false,\"transform_matrix\":"                    \
    "[[0,0,1,2],[0,1,0,1],[-1,0,0,3],[0,0,0,1]]}]}"

/* As downloaded, and with the photographs without distortion only: the lens follows the photographs. */
static void test_scannetpp(void) {
    source_rig_start(&rig, "ScanNet++");
    put("scans/mesh_aligned_0.05.ply", "");
    put("dslr/nerfstudio/transforms.json", NERF("OPENCV_FISHEYE", "DSC1.JPG"));
    put("dslr/nerfstudio/transforms_undistorted.json", NERF("PINHOLE", "DSC1.JPG"));
    put("dslr/resized_images/DSC1.JPG", "");
    put("dslr/resized_undistorted_images/DSC1.JPG", "");
    put("dslr/resized_anon_masks/DSC1.png", "");
    put("dslr/resized_undistorted_masks/DSC1.png", "");
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1 && rig.t.frame[0].lens.model == CAMERA_OPENCV_FISHEYE);
    CHECK_STRING(rig.t.frame[0].file, "dslr/resized_images/DSC1.JPG");
    CHECK_STRING(rig.t.frame[0].mask, "dslr/resized_anon_masks/DSC1.png");
    CHECK_NEAR(rig.t.frame[0].world_from_camera.translation[0], 1, 1e-12); /* axes as the mesh has them */
    CHECK_NEAR(rig.t.frame[0].world_from_camera.translation[2], -3, 1e-12);
    source_rig_drop(&rig, "dslr/resized_images/DSC1.JPG");
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 1 && rig.t.frame[0].lens.model == CAMERA_OPENCV);
    CHECK_STRING(rig.t.frame[0].file, "dslr/resized_undistorted_images/DSC1.JPG");
    CHECK_STRING(rig.t.frame[0].mask, "dslr/resized_undistorted_masks/DSC1.png");
    source_rig_stop(&rig);
}

static void test_matterport(void) {
    source_rig_start(&rig, "Matterport3D");
    put("v1/scans/17D/matterport_camera_poses/ab12_pose_1_4.txt", CV_MATRIX);
    put("v1/scans/17D/matterport_camera_intrinsics/ab12_intrinsics_1.txt",
        "1280 1024 1075 1076 629 522 0.1 0 0.01 0.02 0.3");
    put("v1/scans/17D/matterport_color_images/ab12_i1_4.jpg", "");
    const struct frame *frame = check(0, 1, "v1/scans/17D/matterport_color_images/ab12_i1_4.jpg");
    check_lens(&frame->lens, 1075, 629, 522, 0.1, 0.01, 0.02);
    CHECK(frame->lens.k[2] == 0.3 && frame->lens.height == 1024.0);
    put("v1/scans/17D/matterport_camera_intrinsics/ab12_intrinsics_1.txt", "1280 1024");
    source_rig_refused(&rig, "ab12_intrinsics_1.txt");
    source_rig_stop(&rig);
}

/* The largest of several models, and which folder has its photographs. */
static void test_colmap_models(void) {
    static const char cameras[] = "1 PINHOLE 64 48 50 51 32 24\n";
    source_rig_start(&rig, "COLMAP");
    put("a/sparse/0/cameras.txt", cameras);
    put("a/sparse/0/images.txt", "1 1 0 0 0 0 0 0 1 x.jpg\n\n");
    put("a/sparse/1/cameras.txt", "\xef\xbb\xbf"
                                  "1 PINHOLE 64 48 50 51 32 24\r\n");
    put("a/sparse/1/images.txt", "1 1 0 0 0 0 0 0 1 y.jpg\n\n2 1 0 0 0 1 0 0 1 z.jpg\n\n");
    put("a/photos/x.jpg", "");
    put("a/photos/y.jpg", "");
    put("a/photos/z.jpg", "");
    CHECK(source_rig_read(&rig) && rig.t.frame_count == 2);
    CHECK_STRING(rig.t.frame[1].file, "a/photos/z.jpg");
    CHECK(source_rig_warned(&rig, "2 models of COLMAP: a/sparse/1/images.txt is taken"));
    CHECK(source_rig_warned(&rig, "1 photographs in a/photos/ have no pose"));
    source_rig_stop(&rig);
}

int main(void) {
    test_record3d();
    test_scanner3d();
    test_polycam_alignment();
    test_bundler();
    test_openmvg();
    test_alicevision();
    test_alicevision_rig();
    test_opensfm();
    test_realitycapture();
    test_realitycapture_xmp();
    test_metashape();
    test_arkitscenes();
    test_tum();
    test_sevenscenes();
    test_scannetpp();
    test_matterport();
    test_colmap_models();
    return check_result();
}
