// Stands for HDRP's file of this name in the tests: the view matrix lacks the camera's place, as there.
#include "UnityCG.cginc"
float4 _ScreenSize;
#ifdef UNITY_STEREO_INSTANCING_ENABLED
#define _WorldSpaceCameraPos _XRWorldSpaceCameraPos[unity_StereoEyeIndex]
float4 _XRWorldSpaceCameraPos[2];
#else
float4 _WorldSpaceCameraPos;
#endif
float3 GetCameraRelativePositionWS(float3 place) { return place - _WorldSpaceCameraPos.xyz; }
#ifdef MESH
#define UNITY_MATRIX_UNJITTERED_VP _NonJitteredViewProjMatrix
#define UNITY_MATRIX_PREV_VP _PrevViewProjMatrix
#define UNITY_PREV_MATRIX_M unity_MatrixPreviousM
float4x4 unity_MatrixPreviousM;
float4x4 _NonJitteredViewProjMatrix;
float4x4 _PrevViewProjMatrix;
float4 unity_MotionVectorsParams;
float3 TransformObjectToWorld(float3 place) { return GetCameraRelativePositionWS(mul(unity_ObjectToWorld, float4(place, 1)).xyz); }
#else
#define UNITY_UV_STARTS_AT_TOP 1
#define UNITY_MATRIX_I_VP _InvViewProjMatrix
#define ZERO_INITIALIZE(type, name) name = (type)0
float4x4 _InvViewProjMatrix;
struct PositionInputs
{
    float3 positionWS;
    float2 positionNDC;
    float deviceDepth;
    float linearDepth;
};
float3 ComputeWorldSpacePosition(float2 screen, float depth, float4x4 toWorld)
{
    float4 place = mul(toWorld, float4(screen.x * 2 - 1, 1 - screen.y * 2, depth, 1));
    return place.xyz / place.w;
}
float LinearEyeDepth(float3 place, float4x4 view) { return abs(mul(view, float4(place, 1)).z); }
float3 GetWorldSpaceNormalizeViewDir(float3 place) { return -normalize(place); }
Texture2D<float4> _ColorPyramidTexture;
float3 LoadCameraColor(uint2 pixel, uint level) { return _ColorPyramidTexture.Load(int3(pixel, level)).rgb; }
#endif
