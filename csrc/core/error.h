/* Error codes of the core: one list that defines the enumeration, the messages and the Python exceptions. */
#pragma once

/* X(code, exception raised by the Python layer, message) */
#define GR_ERRORS(X)                                                                           \
    X(GR_OK, NONE, "no error")                                                                 \
    X(GR_ERR_MEMORY, MEMORY, "the core could not allocate memory")                             \
    X(GR_ERR_CAPACITY, INTERNAL, "the point arrays are too small for the grouped points")      \
    X(GR_ERR_NOT_FINITE, SIMULATION, "a material point is not finite")                         \
    X(GR_ERR_RUNAWAY, SIMULATION, "a material point crossed more than one cell in a step")     \
    X(GR_ERR_OUTSIDE, VALUE, "a material point lies outside the grid")                         \
    X(GR_ERR_CONFIG, VALUE, "the configuration is not valid")                                  \
    X(GR_ERR_LIMIT, VALUE, "the time step is too long for the diffusion of the fluidity")      \
    X(GR_ERR_DIVERGED, SIMULATION, "the conjugate gradients of the fluidity did not converge") \
    X(GR_ERR_LAW, SIMULATION, "the function of a user-defined law failed")                     \
    X(GR_ERR_ELSEWHERE, SIMULATION, "the step has failed in another process of the run")       \
    X(GR_ERR_DEVICE, SIMULATION, "the device has failed")                                      \
    X(GR_ERR_TRANSPORT, INTERNAL, "another process of the run does not answer")                \
    X(GR_ERR_REPEATED, INTERNAL,                                                               \
      "the function of a user-defined law was interrupted; it was called again, and the state is valid")

#define GR_X(code, exception, message) code,
enum gr_error { GR_ERRORS(GR_X) GR_ERROR_COUNT };
#undef GR_X

const char *gr_error_message(int code);
