using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>
    /// The room behind the person, and before her what is nearer than she is: hands, furniture, people. A room that measures depth writes
    /// it before the transparent things are drawn; edges are hard.
    /// </summary>
    [AddComponentMenu("Gsac/Samples/Gsac Mixed Reality")]
    [DefaultExecutionOrder(9900)]
    public sealed class GsacMixedReality : MonoBehaviour
    {
        static readonly int DepthId = Shader.PropertyToID("GsacRoomDepth");
        static readonly int FromWorldId = Shader.PropertyToID("GsacRoomFromWorld");
        static readonly int MetresId = Shader.PropertyToID("GsacRoomMetres");
        static readonly int AwayId = Shader.PropertyToID("GsacRoomAway");

        [SerializeField] Camera eye = null;
        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("Gsac/Samples/Room Depth")] Shader depthShader = null;
        [SerializeField, Tooltip("Whether the real room is seen.")] bool passthrough = true;

        readonly GsacRoomDepth depth = new GsacRoomDepth();
        IGsacRoom room;
        Material roomDepth;
        Mesh screen;
        bool shown;

        public bool Passthrough
        {
            get { return passthrough; }
            set { passthrough = value; }
        }

        void Start()
        {
            room = GetComponent<IGsacRoom>();
            if (room == null) Debug.LogWarning(name + ": no component here knows the room; add Gsac Meta Room or Gsac AR Room", this);
            if (depthShader != null) roomDepth = new Material(depthShader);
            // the whole picture, wherever the camera looks
            screen = new Mesh { name = "Screen", vertices = new[] { new Vector3(-1, -1, 0), new Vector3(-1, 3, 0), new Vector3(3, -1, 0) } };
            screen.triangles = new[] { 0, 1, 2 };
            screen.bounds = new Bounds(Vector3.zero, new Vector3(1e4f, 1e4f, 1e4f));
            shown = !passthrough;
        }

        void LateUpdate()
        {
            if (room == null || eye == null) return;
            if (shown != passthrough)
            {
                shown = passthrough;
                room.ShowRoom(shown);
                // the room lies under the picture where its alpha is 0
                eye.clearFlags = shown ? CameraClearFlags.SolidColor : CameraClearFlags.Skybox;
                eye.backgroundColor = new Color(0, 0, 0, 0);
            }
            if (!shown || roomDepth == null || !room.TryDepth(depth)) return;
            roomDepth.SetTexture(DepthId, depth.Texture);
            roomDepth.SetMatrixArray(FromWorldId, depth.FromWorld);
            roomDepth.SetVector(MetresId, depth.Metres);
            GsacAvatar person = cast == null ? null : cast.First;
            Vector3 eyeAt = eye.transform.position;
            float away = person == null ? 1 : Vector3.Distance(person.Joints[0].position, eyeAt);
            roomDepth.SetFloat(AwayId, away);
            Graphics.DrawMesh(screen, Matrix4x4.Translate(eyeAt), roomDepth, gameObject.layer, eye);
        }

        void OnDestroy()
        {
            Destroy(screen);
            Destroy(roomDepth);
        }
    }
}
