/* The tracker from Octave: a function ik_tune(model, y) that gives the result as JSON.

     mkoctfile --mex -I/usr/local/include ik_tune.c -lidentikal
     octave> result = jsondecode(ik_tune(fileread("tracker.yaml"), positions));
     octave> result.parameters(1).value */
#include <mex.h>

#include "identikal.h"

void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[]) {
  if (nrhs != 2 || nlhs > 1 || !mxIsChar(prhs[0]) || !mxIsDouble(prhs[1])) {
    mexErrMsgTxt("json = ik_tune(model, y): a model file's text, and a column of samples");
  }
  char *model = mxArrayToString(prhs[0]);
  ik_recording recording = {.y = mxGetPr(prhs[1]), .rows = mxGetNumberOfElements(prhs[1]), .ny = 1};
  ik_result *result = NULL;
  int code = ik_run("tune", model, &recording, 1, NULL, 0, NULL, NULL, &result);
  mxFree(model);
  if (code == 2 || code == 5) {
    mxArray *message = mxCreateString(ik_result_message(result));
    ik_result_free(result);
    mexErrMsgTxt(mxArrayToString(message)); /* both are freed by Octave */
  }
  plhs[0] = mxCreateString(ik_result_json(result));
  ik_result_free(result);
}
