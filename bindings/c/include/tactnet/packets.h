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

/// Kind of a SweepCommand.
enum tactnet_command {
  /// The finger starts to move; the next frame is the first of the sweep.
  TACTNET_COMMAND_START = 1,
  /// The finger has stopped.
  TACTNET_COMMAND_STOP = 2,
  /// The next sweep belongs to another object; the fused sweeps are discarded.
  TACTNET_COMMAND_RESET = 3,
  /// Enroll a new material from the most recent sweeps.
  TACTNET_COMMAND_ENROLL = 4,
  /// Adapt the model to the most recent sweeps of all fingers, which must be of mixed materials.
  TACTNET_COMMAND_ADAPT = 5,
};

/// Stage of a prediction.
enum tactnet_stage {
  /// Prediction during a sweep.
  TACTNET_STAGE_ANYTIME = 1,
  /// Prediction of a complete sweep, without dropout.
  TACTNET_STAGE_PLAIN = 2,
  /// Prediction of a complete sweep with Monte Carlo dropout. If the service has masks, this prediction is fused.
  TACTNET_STAGE_DROPOUT = 3,
};

/// Verdict on whether the material is known.
enum tactnet_verdict {
  /// The classifier is not calibrated, or has not decided yet.
  TACTNET_VERDICT_NOT_TOLD = 0,
  /// The material is one of the trained materials.
  TACTNET_VERDICT_KNOWN = 1,
  /// The material is none of the trained materials.
  TACTNET_VERDICT_UNKNOWN = 2,
};

/// Kind of event of the service.
enum tactnet_event {
  /// No event; the packet carries counters only.
  TACTNET_EVENT_ALIVE = 0,
  /// A sweep started.
  TACTNET_EVENT_BEGUN = 1,
  /// A sweep was classified.
  TACTNET_EVENT_CLASSIFIED = 2,
  /// A sweep was rejected; the text gives the reason.
  TACTNET_EVENT_REJECTED = 3,
  /// The fused sweeps were discarded.
  TACTNET_EVENT_RESET = 4,
  /// A command was refused; the text gives the reason.
  TACTNET_EVENT_REFUSED = 5,
  /// Another model serves from now on.
  TACTNET_EVENT_SWAPPED = 6,
  /// A new model was refused; the text gives the reason.
  TACTNET_EVENT_MODEL_REJECTED = 7,
  /// A new material was enrolled; the text names it.
  TACTNET_EVENT_ENROLLED = 8,
  /// A component cannot be reached; the text gives the reason.
  TACTNET_EVENT_UNREACHABLE = 9,
  /// The sweeps of this object, the newest of which the packet names, are like the training data; the text gives
  /// p-values.
  TACTNET_EVENT_LIKE = 10,
  /// They differ from the training data no more than its recording blocks differ from one another.
  TACTNET_EVENT_OTHER_BLOCK = 11,
  /// They are unlike the training data; the text says what differs.
  TACTNET_EVENT_UNLIKE = 12,
  /// Other taxels are masked as dead from now on; the text names them.
  TACTNET_EVENT_MASKED = 13,
  /// The model was adapted to recent sweeps; the text says by how much.
  TACTNET_EVENT_ADAPTED = 14,
};

/// One frame of a finger's skin. 4120 bytes.
typedef struct tactnet_skin_frame {
  /// Number of the frame since the sensor started; a gap is a lost frame.
  uint64_t sequence;
  /// Measurement time by the sensor's clock, in ns.
  uint64_t sensor_time_ns;
  /// Number of valid taxels.
  uint32_t taxels;
  /// Always zero.
  uint32_t reserved;
  /// Taxel values in digits, row by row; unused entries are zero. taxels says how many are valid.
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

/// A command of the motion controller or a person. 80 bytes.
typedef struct tactnet_sweep_command {
  /// The command; see Command.
  uint32_t kind;
  /// Index of the finger in the service's table, from 0.
  uint32_t finger;
  /// Number of the motion, which the beliefs repeat.
  uint64_t motion;
  /// For Command Enroll and Command Adapt: number of most recent complete sweeps to use.
  uint32_t sweeps;
  /// Always zero.
  uint32_t reserved;
  /// For Command Enroll: name of the new material. For Command Start: the material under the finger, if known. It
  /// is recorded; the classifier ignores it.
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

/// A prediction of the material. 632 bytes.
typedef struct tactnet_tactile_belief {
  /// Number of the sweep since the service started, from 1.
  uint64_t sweep;
  /// Number of the motion from the command; 0 without a command.
  uint64_t motion;
  /// Version of the model.
  uint64_t model_version;
  /// Sequence number of the newest frame used.
  uint64_t last_frame;
  /// Delay between the sending of that frame and the sending of this packet, in ns.
  uint64_t latency_ns;
  /// Stage of the prediction; see Stage.
  uint32_t stage;
  /// Index of the finger.
  uint32_t finger;
  /// Number of frames of the window used.
  uint32_t frames;
  /// Number of interpolated frames among them.
  uint32_t filled_in;
  /// Number of valid materials.
  uint32_t materials;
  /// Label of the most probable material of this sweep.
  uint32_t label;
  /// Verdict of this sweep; see Verdict.
  uint32_t verdict;
  /// Entropy of posterior, in nats.
  float entropy;
  /// Novelty score of the sweep; undefined without a verdict.
  float strangeness;
  /// Threshold for the novelty score.
  float threshold;
  /// Number of sweeps in fused. If 0, fused is uniform.
  uint32_t fused_sweeps;
  /// Label of the most probable material of the fused sweeps.
  uint32_t fused_label;
  /// Entropy of fused, in nats.
  float fused_entropy;
  /// Verdict of the object, from the mean novelty score of its complete sweeps; see Verdict.
  uint32_t fused_verdict;
  /// Probabilities given this sweep alone; unused entries are zero. materials says how many are valid.
  float posterior[64];
  /// Probabilities given all fused sweeps; unused entries are zero. materials says how many are valid.
  float fused[64];
  /// Always zero.
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

/// Counters of the service, since its start. 72 bytes.
typedef struct tactnet_counters {
  /// Number of received frames.
  uint64_t frames;
  /// Number of frames that were sent but not received.
  uint64_t dropped_frames;
  /// Number of beliefs sent.
  uint64_t beliefs;
  /// Number of complete sweeps classified.
  uint64_t sweeps;
  /// Number of rejected sweeps.
  uint64_t rejected;
  /// Number of complete sweeps of unknown materials.
  uint64_t unknown;
  /// Number of predictions that missed their deadline.
  uint64_t deadline_misses;
  /// Maximum time from the sending of a frame to the end of its processing, in ns.
  uint64_t worst_delay_ns;
  /// Number of allocations of the frame thread while it processed frames.
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

/// An event of the service, with its counters. 296 bytes.
typedef struct tactnet_tactile_status {
  /// The event; see Event.
  uint32_t event;
  /// Index of the finger.
  uint32_t finger;
  /// Number of the sweep.
  uint64_t sweep;
  /// Number of the motion.
  uint64_t motion;
  /// Version of the serving model.
  uint64_t model_version;
  /// Counters since the service started.
  tactnet_counters counters;
  /// One line of text for people.
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

/// Materials and shape of the serving model. 4136 bytes.
typedef struct tactnet_model_names {
  /// Version of the model.
  uint64_t version;
  /// Sample rate, in frames per second.
  double sample_rate_hz;
  /// Number of frames in a window.
  uint32_t steps;
  /// Number of taxel rows.
  uint32_t rows;
  /// Number of taxel columns.
  uint32_t cols;
  /// Number of Monte Carlo dropout masks.
  uint32_t mc_samples;
  /// Number of valid materials.
  uint32_t materials;
  /// Always zero.
  uint32_t reserved;
  /// Names of the materials, by label. materials says how many are valid.
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
