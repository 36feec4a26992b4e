// Stands for Unity's file of this name in a headset's single-pass instanced drawing: an eye for every second instance.
#define UNITY_STEREO_INSTANCING_ENABLED
#define UNITY_MATRIX_V unity_StereoMatrixV[unity_StereoEyeIndex]
#define UNITY_MATRIX_P unity_StereoMatrixP[unity_StereoEyeIndex]
#define UNITY_VERTEX_INPUT_INSTANCE_ID uint instanceID : SV_InstanceID;
// the real one names the target's slice, which needs more than a test's GPU gives
#define UNITY_VERTEX_OUTPUT_STEREO nointerpolation uint stereoTargetEyeIndexAsRTArrayIdx : TEXCOORD7;
#define UNITY_SETUP_INSTANCE_ID(input) unity_StereoEyeIndex = input.instanceID & 1
#define UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output) output.stereoTargetEyeIndexAsRTArrayIdx = unity_StereoEyeIndex
#define UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input) unity_StereoEyeIndex = input.stereoTargetEyeIndexAsRTArrayIdx
float4x4 unity_StereoMatrixV[2];
float4x4 unity_StereoMatrixP[2];
float4 _ScreenParams;
static uint unity_StereoEyeIndex;
