/* The interface of ivis.h without a network: a worker thread of this process solves for the latest
 * pose. For a renderer with a core to spare. Library ivis_local; everything but opening is in
 * ivis.h. A pose that cannot be solved (out of memory) gets every object, and ivis_client_error()
 * says why. */
#ifndef IVIS_IVIS_LOCAL_H
#define IVIS_IVIS_LOCAL_H

#include <ivis/ivis.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ivis_local_options {
  uint32_t size;             /* of this struct, as ivis_local_options_default() set it */
  const char* scene_file;    /* .glb or .gltf */
  const char* occluder_file; /* .ivo; NULL: shrink while opening, which takes seconds for a city */
  const char* reach;         /* NULL: that of the occluder file, or cylinder:1.5,0.1 */
  const char* method;        /* NULL: the default */
  ivis_policy policy;
  uint32_t threads;        /* inside one solve; 1 */
  const char* granularity; /* "object" or "cluster", as the occluder file was made; NULL: object */
} ivis_local_options;

IVIS_API ivis_local_options ivis_local_options_default(void);

/* Loads, prepares, starts the worker. Errors: IO, INPUT, MISMATCH, ARGUMENT, with a line in
 * `error`. *client: as from ivis_client_connect(); closing it ends the worker. */
IVIS_API ivis_status ivis_local_open(const ivis_local_options* options, ivis_client** client,
                                     char* error, size_t error_size);

#ifdef __cplusplus
}
#endif
#endif
