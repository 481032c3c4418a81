/* Packets of tactnet: plain data, little endian, without padding. Generated from serving/skin/src/packets.rs; do not edit. */
#ifndef TACTNET_PACKETS_H
#define TACTNET_PACKETS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define TACTNET_STATIC_ASSERT static_assert
#else
#define TACTNET_STATIC_ASSERT _Static_assert
#endif

/// Most taxels of a frame.
#define TACTNET_MAX_TAXELS 1024

/// Most materials of a classifier that serves.
#define TACTNET_MAX_MATERIALS 64

/// The request of a SweepCommand.
enum tactnet_command {
  /// The finger begins to move; the next frame is the first of the sweep.
  TACTNET_COMMAND_START = 1,
  /// The finger has stopped.
  TACTNET_COMMAND_STOP = 2,
  /// The next sweep is of another object: forget what was fused.
  TACTNET_COMMAND_RESET = 3,
  /// Learn a new material from the newest sweeps.
  TACTNET_COMMAND_ENROLL = 4,
};

/// How far a prediction is.
enum tactnet_stage {
  /// Of a sweep that is going on.
  TACTNET_STAGE_ANYTIME = 1,
  /// Of a whole sweep, without dropout.
  TACTNET_STAGE_PLAIN = 2,
  /// Of a whole sweep, by Monte Carlo dropout; this is the one that is fused, where the service has masks.
  TACTNET_STAGE_DROPOUT = 3,
};

/// Known material or not.
enum tactnet_verdict {
  /// The classifier cannot tell, or not yet.
  TACTNET_VERDICT_NOT_TOLD = 0,
  /// It is one of the materials.
  TACTNET_VERDICT_KNOWN = 1,
  /// It is none of them.
  TACTNET_VERDICT_UNKNOWN = 2,
};

/// An event of the service.
enum tactnet_event {
  /// Nothing; counters only.
  TACTNET_EVENT_ALIVE = 0,
  /// A sweep began.
  TACTNET_EVENT_BEGUN = 1,
  /// A sweep was classified.
  TACTNET_EVENT_CLASSIFIED = 2,
  /// A sweep cannot be used; the text says why.
  TACTNET_EVENT_REJECTED = 3,
  /// The fused sweeps were forgotten.
  TACTNET_EVENT_RESET = 4,
  /// A command cannot be followed; the text says why.
  TACTNET_EVENT_REFUSED = 5,
  /// Another model serves from now on.
  TACTNET_EVENT_SWAPPED = 6,
  /// A new model cannot serve; the text says why.
  TACTNET_EVENT_MODEL_REJECTED = 7,
  /// A new material was learnt; the text names it.
  TACTNET_EVENT_ENROLLED = 8,
  /// A component cannot be reached; the text says why.
  TACTNET_EVENT_UNREACHABLE = 9,
};

/// One frame of a finger's skin. 4120 bytes.
typedef struct tactnet_skin_frame {
  /// Number of the frame since the sensor started; a gap is a lost frame.
  uint64_t sequence;
  /// Time of the measurement by the sensor's clock, nanoseconds.
  uint64_t sensor_time_ns;
  /// Number of taxels that are valid.
  uint32_t taxels;
  /// Zero.
  uint32_t reserved;
  /// Digits, row by row; the rest is zero. taxels says how many are valid.
  float digits[1024];
} tactnet_skin_frame;
#define TACTNET_SKIN_FRAME_NAME "SkinFrame"
#define TACTNET_SKIN_FRAME_VERSION 2
TACTNET_STATIC_ASSERT(sizeof(tactnet_skin_frame) == 4120, "size of tactnet_skin_frame");
TACTNET_STATIC_ASSERT(offsetof(tactnet_skin_frame, sequence) == 0, "offset of tactnet_skin_frame.sequence");
TACTNET_STATIC_ASSERT(offsetof(tactnet_skin_frame, sensor_time_ns) == 8, "offset of tactnet_skin_frame.sensor_time_ns");
TACTNET_STATIC_ASSERT(offsetof(tactnet_skin_frame, taxels) == 16, "offset of tactnet_skin_frame.taxels");
TACTNET_STATIC_ASSERT(offsetof(tactnet_skin_frame, reserved) == 20, "offset of tactnet_skin_frame.reserved");
TACTNET_STATIC_ASSERT(offsetof(tactnet_skin_frame, digits) == 24, "offset of tactnet_skin_frame.digits");

/// A wish of the motion controller or a person. 80 bytes.
typedef struct tactnet_sweep_command {
  /// See Command.
  uint32_t kind;
  /// Number of the finger, from 0, in the order of the service's table.
  uint32_t finger;
  /// Number of the motion; comes back with beliefs.
  uint64_t motion;
  /// For Command Enroll: number of sweeps to take, the newest that were complete.
  uint32_t sweeps;
  /// Zero.
  uint32_t reserved;
  /// For Command Enroll: name of the new material; for Command Start: what is swept over, where that is known (it
  /// is recorded, the classifier does not look).
  char material[56];
} tactnet_sweep_command;
#define TACTNET_SWEEP_COMMAND_NAME "SweepCommand"
#define TACTNET_SWEEP_COMMAND_VERSION 1
TACTNET_STATIC_ASSERT(sizeof(tactnet_sweep_command) == 80, "size of tactnet_sweep_command");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, kind) == 0, "offset of tactnet_sweep_command.kind");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, finger) == 4, "offset of tactnet_sweep_command.finger");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, motion) == 8, "offset of tactnet_sweep_command.motion");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, sweeps) == 16, "offset of tactnet_sweep_command.sweeps");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, reserved) == 20, "offset of tactnet_sweep_command.reserved");
TACTNET_STATIC_ASSERT(offsetof(tactnet_sweep_command, material) == 24, "offset of tactnet_sweep_command.material");

/// A belief about the material. 632 bytes.
typedef struct tactnet_tactile_belief {
  /// Number of the sweep since the service started, from 1.
  uint64_t sweep;
  /// Number of the motion, as commanded; 0 if nobody commanded.
  uint64_t motion;
  /// Version of the model.
  uint64_t model_version;
  /// Sequence of the newest frame that was used.
  uint64_t last_frame;
  /// From that frame's put to this packet's, nanoseconds.
  uint64_t latency_ns;
  /// See Stage.
  uint32_t stage;
  /// Number of the finger.
  uint32_t finger;
  /// Frames of the window that were used.
  uint32_t frames;
  /// How many of them were interpolated.
  uint32_t filled_in;
  /// Number of materials that are valid.
  uint32_t materials;
  /// Most probable material of this sweep.
  uint32_t label;
  /// See Verdict.
  uint32_t verdict;
  /// Entropy of posterior, nats.
  float entropy;
  /// How strange the sweep is; meaningless without a verdict.
  float strangeness;
  /// What it was compared with.
  float threshold;
  /// Number of sweeps in fused; 0: it is flat.
  uint32_t fused_sweeps;
  /// Most probable material of the fused sweeps.
  uint32_t fused_label;
  /// Entropy of fused, nats.
  float fused_entropy;
  /// Whether the object is known, given the mean strangeness of its whole sweeps; see Verdict.
  uint32_t fused_verdict;
  /// Probabilities given this sweep alone; the rest is zero. materials says how many are valid.
  float posterior[64];
  /// Probabilities given all fused sweeps; the rest is zero. materials says how many are valid.
  float fused[64];
  /// Zero.
  uint64_t reserved_end[3];
} tactnet_tactile_belief;
#define TACTNET_TACTILE_BELIEF_NAME "TactileBelief"
#define TACTNET_TACTILE_BELIEF_VERSION 2
TACTNET_STATIC_ASSERT(sizeof(tactnet_tactile_belief) == 632, "size of tactnet_tactile_belief");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, sweep) == 0, "offset of tactnet_tactile_belief.sweep");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, motion) == 8, "offset of tactnet_tactile_belief.motion");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, model_version) == 16, "offset of tactnet_tactile_belief.model_version");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, last_frame) == 24, "offset of tactnet_tactile_belief.last_frame");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, latency_ns) == 32, "offset of tactnet_tactile_belief.latency_ns");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, stage) == 40, "offset of tactnet_tactile_belief.stage");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, finger) == 44, "offset of tactnet_tactile_belief.finger");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, frames) == 48, "offset of tactnet_tactile_belief.frames");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, filled_in) == 52, "offset of tactnet_tactile_belief.filled_in");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, materials) == 56, "offset of tactnet_tactile_belief.materials");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, label) == 60, "offset of tactnet_tactile_belief.label");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, verdict) == 64, "offset of tactnet_tactile_belief.verdict");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, entropy) == 68, "offset of tactnet_tactile_belief.entropy");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, strangeness) == 72, "offset of tactnet_tactile_belief.strangeness");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, threshold) == 76, "offset of tactnet_tactile_belief.threshold");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, fused_sweeps) == 80, "offset of tactnet_tactile_belief.fused_sweeps");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, fused_label) == 84, "offset of tactnet_tactile_belief.fused_label");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, fused_entropy) == 88, "offset of tactnet_tactile_belief.fused_entropy");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, fused_verdict) == 92, "offset of tactnet_tactile_belief.fused_verdict");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, posterior) == 96, "offset of tactnet_tactile_belief.posterior");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, fused) == 352, "offset of tactnet_tactile_belief.fused");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_belief, reserved_end) == 608, "offset of tactnet_tactile_belief.reserved_end");

/// Counters of the service. 72 bytes.
typedef struct tactnet_counters {
  /// Frames that came.
  uint64_t frames;
  /// Frames that were put and never came.
  uint64_t dropped_frames;
  /// Beliefs that were put.
  uint64_t beliefs;
  /// Whole sweeps classified.
  uint64_t sweeps;
  /// Sweeps that were rejected.
  uint64_t rejected;
  /// Whole sweeps of unknown materials.
  uint64_t unknown;
  /// Predictions that took longer than promised.
  uint64_t deadline_misses;
  /// Longest time from a frame's put until the service had dealt with it, nanoseconds.
  uint64_t worst_delay_ns;
  /// Allocations of the thread that follows frames, while it followed them.
  uint64_t allocations;
} tactnet_counters;
TACTNET_STATIC_ASSERT(sizeof(tactnet_counters) == 72, "size of tactnet_counters");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, frames) == 0, "offset of tactnet_counters.frames");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, dropped_frames) == 8, "offset of tactnet_counters.dropped_frames");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, beliefs) == 16, "offset of tactnet_counters.beliefs");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, sweeps) == 24, "offset of tactnet_counters.sweeps");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, rejected) == 32, "offset of tactnet_counters.rejected");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, unknown) == 40, "offset of tactnet_counters.unknown");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, deadline_misses) == 48, "offset of tactnet_counters.deadline_misses");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, worst_delay_ns) == 56, "offset of tactnet_counters.worst_delay_ns");
TACTNET_STATIC_ASSERT(offsetof(tactnet_counters, allocations) == 64, "offset of tactnet_counters.allocations");

/// Events and counters of the service. 296 bytes.
typedef struct tactnet_tactile_status {
  /// See Event.
  uint32_t event;
  /// Number of the finger.
  uint32_t finger;
  /// Number of the sweep.
  uint64_t sweep;
  /// Number of the motion.
  uint64_t motion;
  /// Version of the model that serves.
  uint64_t model_version;
  /// Since the service started.
  tactnet_counters counters;
  /// For people, one line.
  char text[192];
} tactnet_tactile_status;
#define TACTNET_TACTILE_STATUS_NAME "TactileStatus"
#define TACTNET_TACTILE_STATUS_VERSION 1
TACTNET_STATIC_ASSERT(sizeof(tactnet_tactile_status) == 296, "size of tactnet_tactile_status");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, event) == 0, "offset of tactnet_tactile_status.event");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, finger) == 4, "offset of tactnet_tactile_status.finger");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, sweep) == 8, "offset of tactnet_tactile_status.sweep");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, motion) == 16, "offset of tactnet_tactile_status.motion");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, model_version) == 24, "offset of tactnet_tactile_status.model_version");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, counters) == 32, "offset of tactnet_tactile_status.counters");
TACTNET_STATIC_ASSERT(offsetof(tactnet_tactile_status, text) == 104, "offset of tactnet_tactile_status.text");

/// The materials of the model that serves. 4136 bytes.
typedef struct tactnet_model_names {
  /// Version of the model.
  uint64_t version;
  /// Frames per second.
  double sample_rate_hz;
  /// Frames of a window.
  uint32_t steps;
  /// Rows of taxels.
  uint32_t rows;
  /// Columns of taxels.
  uint32_t cols;
  /// Monte Carlo dropout masks.
  uint32_t mc_samples;
  /// Number of materials that are valid.
  uint32_t materials;
  /// Zero.
  uint32_t reserved;
  /// Their names. materials says how many are valid.
  char names[64][64];
} tactnet_model_names;
#define TACTNET_MODEL_NAMES_NAME "ModelNames"
#define TACTNET_MODEL_NAMES_VERSION 1
TACTNET_STATIC_ASSERT(sizeof(tactnet_model_names) == 4136, "size of tactnet_model_names");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, version) == 0, "offset of tactnet_model_names.version");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, sample_rate_hz) == 8, "offset of tactnet_model_names.sample_rate_hz");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, steps) == 16, "offset of tactnet_model_names.steps");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, rows) == 20, "offset of tactnet_model_names.rows");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, cols) == 24, "offset of tactnet_model_names.cols");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, mc_samples) == 28, "offset of tactnet_model_names.mc_samples");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, materials) == 32, "offset of tactnet_model_names.materials");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, reserved) == 36, "offset of tactnet_model_names.reserved");
TACTNET_STATIC_ASSERT(offsetof(tactnet_model_names, names) == 40, "offset of tactnet_model_names.names");

#endif
