using UnityEngine;
using UnityEngine.XR;

namespace Gsac
{
    /// <summary>How a camera looks at the world: one view and projection, of a headset two.</summary>
    public sealed class GsacEyes
    {
        public const int Most = 2;

        /// <summary>World to the eye, -z ahead; and to clip space. As many count as `Count` says.</summary>
        public readonly Matrix4x4[] Views = new Matrix4x4[Most], Lenses = new Matrix4x4[Most];

        public int Count { get; private set; }

        /// <summary>px of what an eye is shown.</summary>
        public int Width { get; private set; }
        public int Height { get; private set; }

        public void Take(Camera camera)
        {
            Count = camera.stereoEnabled ? Most : 1;
            Width = Count == Most ? XRSettings.eyeTextureWidth : camera.pixelWidth;
            Height = Count == Most ? XRSettings.eyeTextureHeight : camera.pixelHeight;
            for (int e = 0; e < Count; e++)
            {
                var eye = (Camera.StereoscopicEye)e;
                Views[e] = Count == Most ? camera.GetStereoViewMatrix(eye) : camera.worldToCameraMatrix;
                Lenses[e] = Count == Most ? camera.GetStereoProjectionMatrix(eye) : camera.projectionMatrix;
            }
        }

        /// <summary>Where an eye is in the world.</summary>
        public Vector3 Place(int eye)
        {
            Matrix4x4 m = Views[eye]; // rigid: its inverse is its transpose
            return -new Vector3(m.m00 * m.m03 + m.m10 * m.m13 + m.m20 * m.m23, m.m01 * m.m03 + m.m11 * m.m13 + m.m21 * m.m23,
                                m.m02 * m.m03 + m.m12 * m.m13 + m.m22 * m.m23);
        }
    }
}
