using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>A person's picture for the Project window: head and shoulders from the front, on nothing.</summary>
    public static class GsacThumbnail
    {
        const int Size = 128;
        const float Margin = 1.1f;

        /// <summary>data: mirrored.</summary>
        public static Texture2D Paint(GsacData data)
        {
            float low = float.MaxValue, high = float.MinValue, middle = 0;
            for (int v = 1; v < data.Vertices.Length; v += 3)
            {
                low = Math.Min(low, data.Vertices[v]);
                high = Math.Max(high, data.Vertices[v]);
            }
            int chest = data.Joint("spine2");
            if (chest >= 0)
            {
                low = data.Joints[chest * 3 + 1];
                middle = data.Joints[chest * 3];
            }
            // from 10 m before the person, who looks along +z; without perspective
            Matrix4x4 toEye = Matrix4x4.identity, lens = Matrix4x4.identity;
            toEye.m00 = -1;
            toEye.m03 = middle;
            toEye.m13 = data.Ground - (low + high) / 2;
            toEye.m22 = 1;
            toEye.m23 = -10;
            lens.m00 = lens.m11 = 2 / (Margin * (high - low));
            float[] picture = GsacPainter.Paint(data, null, null, toEye, lens, Size, Size);
            var pixels = new Color32[Size * Size];
            for (int i = 0; i < pixels.Length; i++)
            {
                // Unity's first row is the lowest
                int at = ((Size - 1 - i / Size) * Size + i % Size) * 4;
                float alpha = Math.Max(picture[at + 3], 1e-6f);
                pixels[i] = new Color32(Byte(picture[at] / alpha), Byte(picture[at + 1] / alpha), Byte(picture[at + 2] / alpha), Byte(picture[at + 3]));
            }
            var texture = new Texture2D(Size, Size) { name = "Thumbnail" };
            texture.SetPixels32(pixels);
            texture.Apply();
            return texture;
        }

        static byte Byte(float share)
        {
            return (byte)Mathf.Clamp(share * 255 + 0.5f, 0, 255);
        }
    }
}
