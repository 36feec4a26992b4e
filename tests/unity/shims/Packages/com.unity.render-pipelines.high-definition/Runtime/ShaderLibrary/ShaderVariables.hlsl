// Stands for HDRP's file of this name in the tests: the view matrix lacks the camera's place, as there.
#include "UnityCG.cginc"
float4 _ScreenSize;
float4 _WorldSpaceCameraPos;
float3 GetCameraRelativePositionWS(float3 place) { return place - _WorldSpaceCameraPos.xyz; }
