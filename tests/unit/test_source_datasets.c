/* test_source_datasets.c -- readers of phones' recordings and of data sets that have no capture in the test data:
 * source_view.h. */
#include "tests/unit/source_view.h"

#define RECORD3D_POSE                                                                                                  \
    "-0.013836534202164496, 0.55858944765791385, 0.0093201028826282138, 0.82927648992725178, 4.2707862854003906, 1.7705957889556885, 3.1797852516174316"
#define SCANNER_POSE                                                                                                   \
    "0.37578195333480835, -0.030915768817067146, 0.92619222402572632, 4.2707862854003906, 0, 0.99944329261779785, 0.033360846340656281, 1.7705957889556885, -0.9267081618309021, -0.012536403723061085, 0.37557274103164673, 3.1797852516174316, 0, 0, 0, 1"
#define CV_MATRIX                                                                                                      \
    "0.37578195333480835 0.030915768817067146 -0.92619222402572632 4.2707862854003906 0 -0.99944329261779785 -0.033360846340656281 1.7705957889556885 -0.9267081618309021 0.012536403723061085 -0.37557274103164673 3.1797852516174316 0 0 0 1"
#define ARKIT_LINE                                                                                                     \
    "2.6284499300474553 0.029540719009203131 -1.7704883865096552 1.3418485329401335 1.5977123720756299 5.2088782849022852"
#define TUM_LINE                                                                                                       \
    "4.2707862854003906 1.7705957889556885 3.1797852516174316 0.82927648992725178 0.0093201028826282138 -0.55858944765791385 0.013836534202164496"

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
    test_arkitscenes();
    test_tum();
    test_sevenscenes();
    test_scannetpp();
    test_matterport();
    test_colmap_models();
    return check_result();
}
