// Stands for Unity's file of this name in the tests: what the package's shader takes from it, for one eye.
#define UNITY_MATRIX_V unity_MatrixV
#define UNITY_MATRIX_P glstate_matrix_projection
#define UNITY_VERTEX_INPUT_INSTANCE_ID
#define UNITY_VERTEX_OUTPUT_STEREO
#define UNITY_SETUP_INSTANCE_ID(input)
#define UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output)
#define UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input)
float4x4 unity_MatrixV;
float4x4 glstate_matrix_projection;
float4 _ScreenParams;
#ifdef FOG_EXP2
float4 unity_FogParams;
float4 unity_FogColor;
#define UNITY_Z_0_FAR_FROM_CLIPSPACE(z) max(z, 0)
#define UNITY_CALC_FOG_FACTOR_RAW(z) float unityFogFactor = unity_FogParams.x * (z); unityFogFactor = exp2(-unityFogFactor * unityFogFactor)
#endif
#ifdef MESH
#define UNITY_MATRIX_VP mul(glstate_matrix_projection, unity_MatrixV)
#define UNITY_UV_STARTS_AT_TOP 1
float4x4 unity_ObjectToWorld;
float4 UnityClipSpaceShadowCasterPos(float4 place, float3 normal) { return mul(UNITY_MATRIX_VP, mul(unity_ObjectToWorld, float4(place.xyz, 1))); }
float4 UnityApplyLinearShadowBias(float4 clip) { return clip; }
#endif
