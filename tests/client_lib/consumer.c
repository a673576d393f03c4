/* A program in C99 that knows the public headers only. consumer SCENE: walks in process. */
#include <ivis/ivis.h>
#include <ivis/ivis_local.h>

#include <stdio.h>

int main(int argc, char** argv) {
  ivis_local_options options = ivis_local_options_default();
  ivis_client* client = NULL;
  char error[256] = "";
  ivis_info info;
  int i;
  if (argc != 2) return 2;
  options.scene_file = argv[1];
  options.reach = "disc:0.5";
  options.policy = IVIS_POLICY_STALL;
  if (ivis_local_open(&options, &client, error, sizeof error) != IVIS_OK) {
    fprintf(stderr, "%s\n", error);
    return 3;
  }
  if (ivis_client_info(client, &info) != IVIS_OK || info.object_count != 5) return 4;
  for (i = 0; i < 20; ++i) {
    const double eye[3] = {-5.0 - i, 0.5, 0.5};
    ivis_frame frame;
    uint32_t id, node, instance, back, seen = 0;
    if (ivis_client_pose(client, eye) != IVIS_OK) return 5;
    if (ivis_client_wait(client, 20000) != IVIS_OK) return 6;
    if (ivis_client_view(client, eye, &frame) != IVIS_OK || !frame.covered) return 7;
    for (id = 0; id < info.object_count; ++id) {
      if (ivis_frame_visible(&frame, id)) ++seen;
      if (ivis_object_node(client, id, &node, &instance) != IVIS_OK) return 8;
      if (ivis_object_id(client, node, instance, &back) != IVIS_OK || back != id) return 9;
    }
    if (seen != frame.visible_count || !ivis_frame_visible(&frame, 0)) return 10;
  }
  ivis_client_close(client);
  options.scene_file = "/nonexistent.glb";
  if (ivis_local_open(&options, &client, error, sizeof error) == IVIS_OK || client != NULL)
    return 11;
  printf("%s\n", error);
  return 0;
}
