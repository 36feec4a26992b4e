// Stands for HDRP's file of this name in the tests: the view matrix lacks the camera's place, as there.
#include "UnityCG.cginc"
float4 _ScreenSize;
float4 _WorldSpaceCameraPos;
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
#endif
