/* ivis client library: poses out, visible objects in. C99.
 *
 * A client connects to a visibility server, tells it once a frame where the eye is, and is told
 * which objects can be seen from anywhere the eye can get to before the next answer (the view cell:
 * a centre plus a reach, which come with each answer). Nothing here waits for the network but
 * ivis_client_connect() and ivis_client_wait().
 *
 *     ivis_client_options options = ivis_client_options_default();
 *     ivis_client* client = NULL;
 *     char error[256];
 *     if (ivis_client_connect(&options, &client, error, sizeof error) != IVIS_OK) return
 * fail(error); while (running) { ivis_frame frame; ivis_client_frame(client, eye, &frame); for
 * (uint32_t id = 0; id < object_count; ++id) if (ivis_frame_visible(&frame, id)) draw(id,
 * frame.eye);
 *     }
 *     ivis_client_close(client);
 *
 * Guarantee  The view never leaves out an object that can be seen from frame.eye, except under
 *            IVIS_POLICY_INCOMPLETE while frame.covered is 0. What is not known is visible.
 * Units      metres, world space of the scene file, right-handed, +Y up.
 * Threads    One thread at a time per client; different clients are independent. No callbacks.
 * Errors     Functions return ivis_status; ivis_client_error() has the words. A frame is filled in
 *            even when the status is an error: it then says what is still true.
 * Ownership  Strings and the bits of a frame belong to the client; see each.
 */
#ifndef IVIS_IVIS_H
#define IVIS_IVIS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define IVIS_API __attribute__((visibility("default")))
#else
#define IVIS_API
#endif

typedef struct ivis_client ivis_client;

typedef enum ivis_status {
  IVIS_OK = 0,
  IVIS_ERROR_ARGUMENT = 1,   /* a value the caller gave cannot be used */
  IVIS_ERROR_INPUT = 2,      /* a file's or a message's bytes are not what they should be */
  IVIS_ERROR_IO = 3,         /* a file cannot be opened or read */
  IVIS_ERROR_MISMATCH = 4,   /* the server has another scene, version or reach: final */
  IVIS_ERROR_CONNECTION = 5, /* the server is absent, silent or gone; the client keeps trying */
  IVIS_ERROR_TIMEOUT = 6     /* what was waited for did not come in time */
} ivis_status;

/* How fast the observer moves at most, and how often it draws. With it the server gives the
 * smallest cell that holds the observer while a PVS is in use, which the client measures: the
 * faster the answers, the smaller the sets. Faster than told: the policy applies more often,
 * nothing is missed. All 0: not told; cells are as large as the server has. */
typedef struct ivis_pace {
  double horizontal_m_s; /* in the ground plane; 0 to 1e6 */
  double vertical_m_s;
  double frame_s; /* between frames; 0: not told. A server with too much to do goes by it: while a
                     PVS holds longer it may wait for your next, fresher pose */
  double turning_rad_s; /* by which its direction of travel turns at most, as a vehicle's; 0: it may
                           turn at once; at most 1e6. With ivis_client_options.predict and frame_s, and
                           while it turns by less than 1 before the next PVS, cells are the
                           smaller for it: they need not reach back to where it cannot go */
} ivis_pace;

/* What a client does when the eye is outside the cell of the PVS it has. */
typedef enum ivis_policy {
  IVIS_POLICY_EVERYTHING = 0, /* every object is visible until the next PVS arrives; default */
  IVIS_POLICY_STALL = 1,     /* frame.eye is held at the border of the cell, and is covered there */
  IVIS_POLICY_INCOMPLETE = 2 /* the old PVS is used on; objects may be missing */
} ivis_policy;

/* How the server's solves keep to their time; with each the set is complete. */
typedef enum ivis_strategy {
  IVIS_STRATEGY_SERVER = 0,     /* as the server is configured; default */
  IVIS_STRATEGY_GUARANTEED = 1, /* all there is: smallest sets, time bounded by the scene */
  IVIS_STRATEGY_ABORT = 2,      /* draws near occluders first and stops at the budget */
  IVIS_STRATEGY_PREDICTIVE = 3  /* chooses occluders for the budget before drawing */
} ivis_strategy;

typedef struct ivis_client_options {
  uint32_t size;        /* of this struct, as ivis_client_options_default() set it */
  const char* endpoint; /* tcp://HOST:PORT or ipc://PATH; copied */
  uint64_t scene_hash;  /* of the scene you have (`ivis info`); 0: take the server's */
  const char* reach; /* of every cell, e.g. "disc:1", at most the server's; NULL: by pace; copied */
  ivis_policy policy;
  int32_t connect_timeout_ms; /* 0: return at once, connect behind the scenes */
  int32_t silence_timeout_ms; /* an unanswered server counts as gone after this */
  ivis_pace pace;
  uint8_t predict;        /* 1: centre cells where the observer is going, by its last two poses */
  ivis_strategy strategy; /* a wish: a method without budgets does all there is */
  uint32_t budget_us;     /* of one solve; 0: the server's */
  uint32_t linger_frames; /* objects are drawn for so many frames, at most 3600, after they left
                              the set */
  uint8_t follow_scene;   /* 1: when the server loads another scene, go on with that: everything is
                             visible until its first PVS is there; see ivis_frame.scene_hash. 0: that
                             is a MISMATCH for good. Not with a scene_hash */
} ivis_client_options;

/* tcp://127.0.0.1:7447, any scene, the server's largest reach, EVERYTHING, 5000 ms, 2000 ms, no
 * pace, no prediction, the server's strategy, no lingering. */
IVIS_API ivis_client_options ivis_client_options_default(void);

/* Connects and waits until the server has said what it serves.
 * error: receives a line when the result is not IVIS_OK; may be NULL.
 * *client: NULL unless IVIS_OK; give it to ivis_client_close(). */
IVIS_API ivis_status ivis_client_connect(const ivis_client_options* options, ivis_client** client,
                                         char* error, size_t error_size);
/* NULL is allowed. Frees everything the client handed out. */
IVIS_API void ivis_client_close(ivis_client* client);

/* From the next frame on. Errors: ARGUMENT for a policy that is none, speeds out of bounds. */
IVIS_API ivis_status ivis_client_set_policy(ivis_client* client, ivis_policy policy);
IVIS_API ivis_status ivis_client_set_pace(ivis_client* client, const ivis_pace* pace);

/* Why an eye is outside the cell of the PVS in hand; of several reasons the first that holds. */
typedef enum ivis_cause {
  IVIS_CAUSE_NONE = 0,         /* it is not */
  IVIS_CAUSE_NO_ANSWER = 1,    /* there has been no PVS yet */
  IVIS_CAUSE_DISCONNECTED = 2, /* the server is not there */
  IVIS_CAUSE_SPEED = 3,        /* the eye moved or turned faster than the pace told */
  IVIS_CAUSE_LADDER = 4,       /* the server has no cell as large as the pace needs */
  IVIS_CAUSE_LATE = 5,         /* the next PVS is later than those before it were */
  IVIS_CAUSE_OTHER = 6,  /* no pace was told, nothing is measured yet, or a cell was centred by
                             prediction where the eye did not go */
  IVIS_CAUSE_EXPIRED = 7 /* whatever else: what moves by itself may be anywhere by now */
} ivis_cause;
#define IVIS_CAUSES 8

/* What holds for one frame. */
typedef struct ivis_frame {
  double eye[3];         /* draw from here: the eye given, or held back under IVIS_POLICY_STALL */
  uint8_t covered;       /* 1: the set below is complete for `eye` by a PVS in hand */
  uint8_t stalled;       /* 1: `eye` was held back, or time is: under IVIS_CAUSE_EXPIRED what moves
                            by itself is to be held where it is */
  uint8_t everything;    /* 1: every object is visible */
  uint8_t connected;     /* 1: the server has been heard of lately */
  uint32_t sequence;     /* of the pose whose PVS is in use; 0: none yet */
  uint32_t object_count; /* 0 until the server has been met */
  uint32_t visible_count;
  double cell_eye[3];     /* centre of the view cell of that PVS */
  const char* cell_reach; /* and its reach; "" without one; valid as visible_bits */
  uint8_t cause;          /* ivis_cause: why the eye given is outside the cell */
  double pvs_age_s;       /* since the pose of that PVS was sent; 0 without one */
  double margin_m;        /* from the eye to the cell's border, along the ground for upright
                             cells; 0 outside and without one */
  double safe;            /* the part of the pace that cells hold, 0 to 1; 1 while not known */
  uint32_t epoch;         /* of the scene to draw: see ivis_client_changes(); 0: as in the file */
  uint64_t scene_hash;    /* that the ids are of; 0 until the server has been met. Another than
                             before only with ivis_client_options.follow_scene */
  const uint64_t* visible_bits; /* bit (id & 63) of word (id >> 6); valid until the next call with
                                   this client, NULL while object_count is 0 */
} ivis_frame;

/* Sends the pose (a later one overtakes an earlier one that has not left), takes in what has
 * arrived, and says what is visible. Never blocks. Errors: ARGUMENT for an eye that is not finite
 * (nothing is sent, everything is visible); MISMATCH. */
IVIS_API ivis_status ivis_client_frame(ivis_client* client, const double eye[3], ivis_frame* out);

/* The two halves of ivis_client_frame(), for a caller with a wait between them. Only the second
 * counts stalls and uncovered frames. */
IVIS_API ivis_status ivis_client_pose(ivis_client* client, const double eye[3]);
IVIS_API ivis_status ivis_client_view(ivis_client* client, const double eye[3], ivis_frame* out);

/* Blocks until the PVS of the latest pose is there, at most timeout_ms. Errors: TIMEOUT, MISMATCH.
 */
IVIS_API ivis_status ivis_client_wait(ivis_client* client, int32_t timeout_ms);

/* ---- A scene that changes while it is served. ---- */

typedef enum ivis_edit_kind {
  IVIS_EDIT_MOVE = 1,         /* to `position` and `rotation` */
  IVIS_EDIT_REMOVE = 2,       /* it is neither drawn nor hides anything */
  IVIS_EDIT_ADD = 3,          /* a removed object comes back */
  IVIS_EDIT_OCCLUDER_OFF = 4, /* it hides nothing, as an open door; it is drawn all the same */
  IVIS_EDIT_OCCLUDER_ON = 5
} ivis_edit_kind;

typedef struct ivis_edit {
  uint8_t kind;       /* ivis_edit_kind */
  uint32_t id;        /* of an object; of occluders also object_count + k, the k-th node of the file
                         that only occludes */
  double position[3]; /* MOVE: where the origin of the object's node comes to, world metres */
  float rotation[4];  /* x, y, z, w, unit, normalised in double precision by whoever uses it: its
                         turn about that origin from how the scene file has it */
  float speed_m_s;    /* above 0: it goes on by itself, at most so fast: wherever it is drawn at a
                         time t after the server took this edit is within speed * (t + 0.1 s) of
                         `position`, turned as told, and not below the lowest point of the scene
                         file unless, as told, it reaches below that. With the view that tells of a
                         slower speed, or of    none, that counts */
} ivis_edit;

/* Asks the server to change the scene for all its clients: all `count` (1 to 1024) edits in their
 * order, or nothing. Returns at once; *request (may be NULL) names what
 * ivis_client_edit_result() tells. The change shows when a PVS of the changed scene is there.
 * Errors: ARGUMENT for an edit that is none; CONNECTION, then nothing is asked. */
IVIS_API ivis_status ivis_client_edit(ivis_client* client, const ivis_edit* edits, size_t count,
                                      uint32_t* request);

typedef struct ivis_edit_result {
  uint32_t request;
  uint32_t epoch;      /* of the scene as changed; 0: refused, or not known as the session ended */
  const char* refused; /* why; "" if done; valid until the next call with this client */
} ivis_edit_result;
/* 1 and the oldest result that was not taken, 0 if there is none. Takes in what has arrived. */
IVIS_API int ivis_client_edit_result(ivis_client* client, ivis_edit_result* out);

typedef struct ivis_object_state {
  uint32_t id;
  uint8_t removed;
  uint8_t occluder_off;
  uint8_t moved;      /* 1: position and rotation hold; 0: it is where the scene file has it */
  double position[3]; /* as in ivis_edit */
  float rotation[4];
  float speed_m_s;
} ivis_object_state;

/* The objects that changed between the view before the last and the last, each as it is in the
 * scene of the last view (ivis_frame.epoch): to be applied before that is drawn. Whoever edited
 * them; after a reconnection also what is as in the file again. Valid until the next view. */
IVIS_API ivis_status ivis_client_changes(ivis_client* client, const ivis_object_state** states,
                                         size_t* count);

/* Can the object be seen? An id that is not known counts as visible. No call, no lock. */
static inline int ivis_frame_visible(const ivis_frame* frame, uint32_t id) {
  return id >= frame->object_count || (int)((frame->visible_bits[id >> 6] >> (id & 63U)) & 1U);
}

typedef struct ivis_stats {
  uint64_t poses;            /* sent or waiting to be */
  uint64_t frames;           /* views taken */
  uint64_t stalls;           /* frames whose eye was held back */
  uint64_t uncovered_frames; /* frames without a PVS valid at their eye */
  uint64_t answers;          /* PVS messages taken in */
  uint64_t bytes;            /* of all PVS messages, envelopes included; 0 in process */
  uint64_t reconnects;       /* sessions begun after the first */
  uint64_t bad_messages;     /* of the server, that could not be used */
  double last_solve_ms;      /* visibility time of the latest answer, as the server measured it */
  double last_round_trip_ms; /* from its pose's sending to its PVS being decoded */
  uint64_t causes[IVIS_CAUSES]; /* frames whose eye was outside the cell, by ivis_cause */
  double held_m;                /* by how far eyes were held back, summed over frames */
  double latency_ms;            /* L: from a pose to its PVS being used, a high quantile */
  double interval_ms;           /* T: between poses whose PVS were used, likewise */
  double hold_ms;               /* for how long past its pose a PVS is used, likewise */
} ivis_stats;
IVIS_API void ivis_client_stats(const ivis_client* client, ivis_stats* out);

/* What the server serves. Strings are valid until the next call with this client. */
typedef struct ivis_info {
  uint64_t scene_hash;
  uint32_t object_count;
  const char* reach; /* of the largest cell, e.g. "cylinder:1.5,0.1" */
  const char* method;
} ivis_info;
/* Errors: CONNECTION while no server has been met. */
IVIS_API ivis_status ivis_client_info(const ivis_client* client, ivis_info* out);

/* id <-> glTF node index and instance (0 unless EXT_mesh_gpu_instancing). Where the server splits
 * large meshes into clusters, several ids have one node and instance: consecutive ones, by
 * ascending cluster, of which ivis_object_id() gives the first.
 * Errors: ARGUMENT for one that the scene has not; CONNECTION while no server has been met. */
IVIS_API ivis_status ivis_object_node(const ivis_client* client, uint32_t id, uint32_t* node,
                                      uint32_t* instance);
IVIS_API ivis_status ivis_object_id(const ivis_client* client, uint32_t node, uint32_t instance,
                                    uint32_t* id);
/* All ids of an instance: *first_id to *first_id + *count - 1; the k-th, from 0, is its cluster k.
 * `ivis objects --granularity cluster --json --triangle-numbers` says which triangles those are.
 * Either pointer may be NULL. Errors: as above. */
IVIS_API ivis_status ivis_object_ids(const ivis_client* client, uint32_t node, uint32_t instance,
                                     uint32_t* first_id, uint32_t* count);
/* The cluster of an object within its instance; 0 when it was not split. Errors: as above. */
IVIS_API ivis_status ivis_object_cluster(const ivis_client* client, uint32_t id, uint32_t* cluster);

/* What went wrong last, for a person; "" if nothing did. Valid until the next call with this
 * client. */
IVIS_API const char* ivis_client_error(const ivis_client* client);
/* Name of a cause, never NULL. */
IVIS_API const char* ivis_cause_name(ivis_cause cause);
/* Name of a status, never NULL. */
IVIS_API const char* ivis_status_name(ivis_status status);

#ifdef __cplusplus
}
#endif
#endif
