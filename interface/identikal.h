/* Identikal for programs in C, and in any language that can call C: fit a model to recordings, tune a Kalman
   filter, run it sample by sample.

     ik_recording nile = {.y = volume, .rows = 100, .ny = 1};
     ik_result* result = NULL;
     int code = ik_run("tune", model_yaml, &nile, 1, NULL, 0, "{\"starts\": 1}", NULL, &result);
     puts(code == 0 ? ik_result_json(result) : ik_result_message(result));
     ik_result_free(result);

   Functions may be called from several threads at once; one result or filter belongs to one thread at a time.
   Texts are UTF-8 and end in a zero byte; what a result gives stays valid until it is freed. Numbers are in SI
   unless a unit is given. Pointers that may be NULL say so. */
#ifndef IDENTIKAL_H
#define IDENTIKAL_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define IK_API __attribute__((visibility("default")))
#else
#define IK_API
#endif

/* Samples of one recording, a row per sample; NaN where a value is missing. */
typedef struct {
  /* rows, rising [s]; NULL: `step` apart, or as the model says, or the column that the model calls its time */
  const double* time;
  const double* y; /* rows x ny, row by row: the outputs */
  const double* u; /* rows x nu: the inputs; NULL where nu is 0 */
  size_t rows, ny, nu;
  double step;              /* [s]; 0: not given */
  const char* const* names; /* ny + nu columns as the model calls them, outputs first; NULL: y and u
                               hold the model's channels in its order */
  const char* const* units; /* ny + nu, each NULL where the model's unit holds; NULL: all hold */
} ik_recording;

typedef struct ik_result ik_result;

/* What ik_run() calls while it works. */
typedef struct {
  size_t size; /* sizeof(ik_callbacks) */
  /* what: a line for people; share: of the work that is done; value: of the objective; NaN: not known.
     Answers 0 to stop with the best so far. The als methods and a posterior on a grid do not ask. */
  int (*progress)(void* user, const char* what, double share, double value);
  void* user;
} ik_callbacks;

/* Runs a verb of the command line: tune, fit, check, shape, track, filter, bound, simulate, forecast, validate,
   compare, handling, model.

   model_yaml  the text of a model file; NULL for validate and compare, whose results hold their models,
               for handling where a result is given, and for model, which finds one
   recordings  `count` of them; of bound and simulate one of the inputs, or none; of compare none. Of model y are
               the outputs and u the inputs, by their names or as y and u, y1, y2, ... where there are several
   previous    the results that the verb starts from: validate has one, compare two or more, handling one
               or none; of filter, forecast and simulate its values are taken. NULL where previous_count is 0
   options     a JSON object whose keys are the long options of the command line without dashes:
               {"starts": 1, "robust": true, "set": ["Cf=80 kN/rad"]}; NULL: none
   callbacks   may be NULL
   result      is set whatever happens, so that it can say why; may be NULL; ik_result_free()

   Answers the exit status of the command line: 0 done and usable, 1 rejected, 2 a mistake in the arguments, 3
   not converged, 4 strict and there are warnings, 5 an internal error or a file that cannot be written. */
IK_API int ik_run(const char* verb, const char* model_yaml, const ik_recording* recordings,
                  size_t count, const ik_result* const* previous, size_t previous_count,
                  const char* options_json, const ik_callbacks* callbacks, ik_result** result);

/* The result as JSON (docs/file-formats.md); of simulate the recording as CSV; empty after a mistake. */
IK_API const char* ik_result_json(const ik_result* result);

/* One line: the status and why, or what is wrong with the arguments; empty of simulate, which has no status. */
IK_API const char* ik_result_message(const ik_result* result);

/* A row per sample, row by row, in the channels' units: "time", "measured", "predicted", "innovations",
   "standardised"; of filter also "states" and "state_sd", in SI; of track "tracked" and "tracked_sd", noise,
   coefficients or tyres as the result has them; of simulate "simulated". NULL, and no rows, where the result
   has no such series. rows and cols may be NULL. */
IK_API const double* ik_result_series(const ik_result* result, const char* name, size_t* rows,
                                      size_t* cols);

/* The result as one HTML page; the first time its pictures are computed, for which the job runs again. Empty
   where a verb has no page. */
IK_API const char* ik_result_report_html(ik_result* result);

/* NULL is ignored. */
IK_API void ik_result_free(ik_result* result);

/* A filter that takes one sample after the other:

     ik_filter* filter = NULL;
     if (ik_filter_open(tuned, NULL, &filter) != 0) puts(ik_filter_message(filter));
     while (receive(y, u)) ik_filter_step(filter, y, u, state, sd, innovation);
     ik_filter_free(filter);

   Its numbers are those of the verb for the whole recording, to 1e-12. */
typedef struct ik_filter ik_filter;

/* Which filter it is lies in what it is opened from:

     of tune, fit, check, filter, shape   the Kalman filter at the values of the result, whose model is linear
     of track, a linear model             the filter whose noise is learnt, as `track` ran it: with "adaptive"
                                          from the values of the model file on, and anew where a change is
                                          found; without, from its priors on
     of track, a regression               recursive least squares with the orders, delta and forgetting that
                                          were given or chosen, from theta = 0 on
     a model_yaml                         the Kalman filter of a linear model that gives its sampling period;
                                          of a regression that leaves nothing open, recursive least squares

   One of result and model_yaml is NULL. filter is set whatever happens, so that it can say why;
   ik_filter_free(). Answers 0, 2 for a mistake in the arguments, 5 for an internal error. */
IK_API int ik_filter_open(const ik_result* result, const char* model_yaml, ik_filter** filter);

/* Takes a sample, in SI. y: an output each, NaN where one is missing or its condition (when) does not hold; of a
   pseudo-measurement its number where it does. u: an input each; may be NULL without
   inputs. innovation: y minus its prediction before the sample, NaN where there is none. state, sd: what y up
   to now determines, NaN before; each may be NULL:

     Kalman filter            states and their standard deviations
     noise that is learnt     the same by the filters of all noise that is probable, weighed: the mean, and what
                              the spread between them adds. ik_filter_parameters() is the noise
     recursive least squares  coefficients and their standard errors, in the channels' units and the order of the
                              result; they stay where a sample is missing, of an input as well

   Allocates nothing once every output has been measured. Noise that is learnt: but when a change has been
   found, when the noise in use is drawn again (both run filters over the samples since the change, which
   takes a thousand times as long as other samples) and when the room for samples doubles.
   Answers 0, 1 where the sample cannot be taken (a value that is infinite, an input of a Kalman filter that is
   missing: nothing has changed; a covariance that is not positive definite: noise that is learnt cannot go
   on), 2 without a filter, 5 without memory. */
IK_API int ik_filter_step(ik_filter* filter, const double* y, const double* u, double* state,
                          double* sd, double* innovation);

/* What is learnt beside the state, in SI: how many numbers that is, 0 of a Kalman filter and of a regression.
   value, sd: the variances and covariances of the noise by now; sd is NaN while the model file's values are in
   use; each may be NULL. */
IK_API size_t ik_filter_parameters(const ik_filter* filter, double* value, double* sd);
/* "q", "Q(1,1)"; empty beyond the last. */
IK_API const char* ik_filter_parameter_name(const ik_filter* filter, size_t index);

/* How many numbers ik_filter_step() reads and writes; 0 without a filter. */
IK_API size_t ik_filter_states(const ik_filter* filter);
IK_API size_t ik_filter_inputs(const ik_filter* filter);
IK_API size_t ik_filter_outputs(const ik_filter* filter);

/* What is wrong with the arguments of ik_filter_open(); empty where nothing is. */
IK_API const char* ik_filter_message(const ik_filter* filter);

/* NULL is ignored. */
IK_API void ik_filter_free(ik_filter* filter);

/* "0.1.0" */
IK_API const char* ik_version(void);

#ifdef __cplusplus
}
#endif

#endif
